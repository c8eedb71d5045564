"""Tables of docs/results/learning.csv and a figure of its curves, for pages."""

import io
import itertools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.evaluation.comparison import read_results
from softgym_mj.evaluation.plots import new_figure
from softgym_mj.learning.curves import DEFAULT_ACTOR
from softgym_mj.learning.results import Name, Reference, Row, read_references, read_rows
from softgym_mj.learning.tables import table as numbers_of
from softgym_mj.policies.exported import has_images
from softgym_mj.policies.planners import PLANNERS
from softgym_mj.registry import TASKS
from softgym_mj.storage.files import write_whole
from softgym_mj.variations.indices import SPLITS
from tools.pages import table
from tools.queued_runs import read_queue

RESULTS = pathlib.Path(__file__).parent.parent / "docs" / "results"
FIGURE = RESULTS / "curves.png"
_WIDTH, _HEIGHT, _LINE, _DPI = 8.4, 2.6, 0.2, 150  # Figure, panels, legends' lines [inches].
# Results of start states that have been replaced since: (task, method, preset, observation).
STALE = {
    ("straighten_rope", "sac", "night", "markov"),
    *((task, "cem", "small", "simulator") for task in
      ("straighten_rope", "rope_configuration", "spread_cloth", "fold_crumpled_cloth")),
}  # fmt: skip
# Titles of methods whose names are no abbreviations.
_TITLES = {
    "teacher_student": "teacher and student", "distill": "distillation", "wu": "Wu et al.",
    "drq": "DrQ", "planet": "PlaNet",
}  # fmt: skip
_KINDS = (
    "RL on states", "imitated expert, states", "images + proprioception", "images alone", "CEM",
)  # fmt: skip
# Colors of methods with their observations: those of Matplotlib without gray, and more.
_MORE = "black", "navy", "darkgreen", "maroon", "gold", "chartreuse"
_COLORS = *(f"C{k}" for k in range(10) if k != 7), *_MORE
_STYLES = "-", ":", "--", "-."  # Line styles of the curves of a method and observation in a panel.
_DASHES = "--", "-.", (0, (1, 4))  # Line styles of published numbers of others in a panel.
_LOWEST = -0.5  # Lower end of the axis: worse policies would squeeze the others.


def rows() -> list[Row]:
    """All rows that are published."""
    return read_rows(RESULTS / "learning.csv")


def references() -> list[Reference]:
    """Numbers of others."""
    return read_references(RESULTS / "references.csv")


def results() -> str:
    """Returns the table of all rows, and the curves if there are any.

    Planners with small budgets are left out: the page has a table of planners.
    """
    lines = []
    for line in (line for line in numbers_of(rows(), references()) if line["preset"] != "small"):
        cells = (
            f"{line['method']}<br>{line['observation'].replace('+', ' + ') or '-'}",
            ", ".join(line[key] for key in ("preset", "replay") if line[key] != "none"),
            _ranged(line, "median", "percentile_25", "percentile_75") + _mark(line),
            f"{line['success_rate']:.2f}",
            _optional(line["gap"], "z.2f"),
            _optional(line["published"], ".2f"),
            f"{line['seeds']}",
            f"{line['env_steps']:,}",
            _optional(line["minutes"], ".0f"),
        )
        lines.append(_row(label(line["task"], line["actor"]), *cells))
    titles = (
        "| task | method<br>observation | preset, replay | median (quartiles) | success "
        "| train - held out | others | seeds | env steps | minutes |"
    )
    found = table(titles, lines)
    if curves(rows()):
        caption = "Curves on held-out variations: medians and quartiles over seeds"
        found += f"\n\n![{caption}](results/{FIGURE.name})\n\n{caption}. "
        found += (
            "The last point of a curve is a mean of 200 variations, earlier ones of 20 of them. "
            "Gray lines (others): scores that [other work](#other-work) published. The axis ends "
            f"at {_LOWEST}. Env steps of `distill` do not include those of its teacher. "
            "`teacher_student` jumps where its teacher ends: the student, which is scored, learns "
            "from then on only."
        )
    if "\u2020" in found:
        found += " \u2020: trained before the task's initial states changed."
    return found


def others() -> str:
    """The table of the numbers of others."""
    lines = []
    for r in references():
        value = f"{'< ' if r.bound == 'below' else ''}{r.value:g}"
        steps = _optional(r.env_steps, ",")
        cells = r.method, r.observation, value, steps, r.certainty, r.source
        lines.append(_row(f"`{r.task}`", *cells))
    titles = "method | observation | normalized performance | env steps | certainty | source"
    return table(f"| task | {titles} |", lines)


def summary() -> str:
    """The matrix of README, and what its columns are."""
    found = matrix()
    notes = (
        "*Cells*: median over three or five seeds, success rate, and the method where it is not "
        "imitation (distillation). Method, and settings of `fold_cloth` and `drop_cloth`, were "
        "chosen by held-out scores, so cells are optimistic. Empty: not run, or "
        "[failed](docs/learning.md#reactive-experts). *Imitated expert*: the student of a "
        "hand-written policy. *Images*: students imitate this or a policy on states; "
        "*proprioception* is what the actor measures of itself. *CEM*: planning in the simulator "
        "itself with the paper's budget, ten episodes. *No action* scores above 0 where the start "
        "lies above the lower bound or grippers release the cloth."
    )
    return found and f"{found}\n\n{notes}"


def overview() -> str:
    """The matrix of docs/results.md, with its notes."""
    found = matrix()
    stale = (
        " \u2020: measured before the task's initial states changed." if "\u2020" in found else ""
    )
    lines = (
        "*Cell*: median over three or five seeds, [success](glossary.md) rate, and the method "
        "where it is not distillation. The method is the column's best by held-out score, which "
        f"makes cells slightly optimistic.{stale} Empty: no row below; [failed students]"
        "(learning.md#reactive-experts) have none.",
        "*No action*: mean over the 200 held-out variations. It is above 0 where the start lies "
        "above the lower bound (`straighten_rope`) or grippers release the cloth (`drop_cloth`, "
        "`drop_fold_cloth`).",
        "*Proprioception*: positions or joints that the actor measures of itself; for grippers "
        "also whether each holds the material.",
        "*Imitated expert*: the student of a hand-written [reactive expert]"
        "(learning.md#reactive-experts).",
        "*Distillation*: a student imitates a teacher, such an expert or one seed of a [state "
        "policy](policies.md), so it can exceed the median over the teacher's seeds."
        f"{_taught_by_functions()}",
        "*CEM*: planning in the simulator itself (true dynamics) without learning; ten episodes, "
        "21,000 env steps per decision as in the paper.",
        "Settings of `fold_cloth` and `drop_cloth` were chosen by held-out scores, which makes "
        "these rows optimistic.",
    )
    return found and found + "\n\n" + "\n".join(f"- {line}" for line in lines)


def _taught_by_functions() -> str:
    """Returns a sentence on published students of a function instead of a saved policy."""
    runs, own = read_queue(RESULTS / "queue.toml"), rows()
    done = {
        (run.task, run.actor) for run in runs if ":" in (run.teacher or "") and run.is_done(own)
    }
    order = [*TASKS]
    students = sorted(done, key=lambda key: (order.index(key[0]), key[1] != DEFAULT_ACTOR, key))
    named = ", ".join(label(*key).replace(", ", " with ") for key in students)
    return f" Experts teach the students of {named}." if named else ""


def matrix() -> str:
    """A table of the best published score of each task and actor by kind of policy.

    It is empty until a learner has final rows. Planners are listed with the paper's budget only.
    """
    lines = [line for line in numbers_of(rows()) if line["preset"] != "small"]
    if all(line["method"] in PLANNERS for line in lines):
        return ""
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for line in sorted(lines, key=lambda line: line["median"]):  # The best one overwrites others.
        cells.setdefault((line["task"], line["actor"]), {})[_kind(line)] = _cell(line)
    nothing = {(task, DEFAULT_ACTOR): score for task, score in idle().items()}
    found = [
        _row(
            label(*key),
            _optional(nothing.get(key), "z.2f"),
            *(cells[key].get(kind, "") for kind in _KINDS),
        )
        for task in TASKS
        for key in sorted(cells, key=lambda key: (key[1] != DEFAULT_ACTOR, key))
        if key[0] == task
    ]
    return table(f"| task | no action | {' | '.join(_KINDS)} |", found)


def label(task: str, actor: str) -> str:
    """Returns the names of a task and of its actor unless it is the default."""
    return f"`{task}`" if actor == DEFAULT_ACTOR else f"`{task}`, `{actor}`"


def idle() -> dict[str, float]:
    """Mean scores of doing nothing over all held-out variations, of the tasks that have them."""
    results = read_results([*sorted((RESULTS / "zero").glob("*.json"))])
    return {
        result["task"]: result["summary"]["mean"]
        for result in results
        if result["policy"] == "zero" and result["variations"] == [*SPLITS["evaluate"]]
    }


def _kind(line: Mapping[str, Any]) -> str:
    """Column of a result in the overview."""
    if line["method"] in PLANNERS:
        return _KINDS[4]
    names = line["observation"].split("+")
    if not has_images(names):
        return _KINDS[line["method"] == "distill"]
    return _KINDS[3 if len(names) == 1 else 2]


def _cell(line: Mapping[str, Any]) -> str:
    """Text of a result in the overview: its median, success rate and method."""
    method = "" if line["method"] in (*PLANNERS, "distill") else f" {_title(line)}"
    return f"{line['median']:z.2f}{_mark(line)} ({round(line['success_rate'], 2):.0%}){method}"


def _title(line: Mapping[str, Any]) -> str:
    return _TITLES.get(line["method"], line["method"].upper())


def _mark(line: Mapping[str, Any]) -> str:
    key = tuple(line[name] for name in ("task", "method", "preset", "observation"))
    return " \u2020" if key in STALE and line["actor"] == DEFAULT_ACTOR else ""


def _row(*cells: str) -> str:
    return "".join(f"| {cell} " if cell else "| " for cell in cells) + "|"


def _ranged(line: Mapping[str, Any], value: str, low: str, high: str) -> str:
    """A number, and its range if it has one."""
    shown = "" if line[low] is None else f" ({line[low]:z.2f} to {line[high]:z.2f})"
    return f"{line[value]:z.2f}{shown}"


def _optional(value: float | None, form: str) -> str:
    return "" if value is None else f"{value:{form}}"


def curves(found: Sequence[Row]) -> dict[Name, np.ndarray]:
    """Curves on held-out variations.

    Returns:
        Env steps, median, low and high quartile over seeds (n, 4), where there are as many seeds
        as anywhere, of each name that has two such points or more.
    """
    scores: dict[Name, dict[int, list[float]]] = {}
    for row in (row for row in found if row.split == "evaluate"):
        at = scores.setdefault(row.name, {}).setdefault(row.env_steps, [])
        at.append(row.normalized_performance)
    drawn = {}
    for name, by_steps in scores.items():
        most = max(map(len, by_steps.values()))  # With fewer seeds the curve would jump.
        steps = sorted(n for n, own in by_steps.items() if len(own) == most)
        if len(steps) > 1:
            drawn[name] = np.array([(n, *np.percentile(by_steps[n], [50, 25, 75])) for n in steps])
    return drawn


def draw(found: Sequence[Row], known: Sequence[Reference], file: pathlib.Path) -> None:
    """Draws the curves of each task; what others have as dashed lines. Nothing without curves."""
    own = curves(found)
    tasks = [task for task in TASKS if any(name.task == task for name in own)]
    if not tasks:
        return
    lines = [sum(name.task == task for name in own) + len(_DASHES) for task in tasks]
    heights = [max(_HEIGHT, _LINE * number + 1.0) for number in lines]
    figure = new_figure(_WIDTH, sum(heights))
    figure.set_layout_engine("constrained")
    ratios = {"height_ratios": heights}
    grid = figure.subplots(len(tasks), squeeze=False, gridspec_kw=ratios)
    for axes, task in zip(grid.flat, tasks, strict=True):
        _panel(axes, task, own, known)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DPI)
    write_whole(file, content.getvalue())


def _color_key(name: Name) -> tuple[str, str]:
    """Returns what has one color in all panels: the method and its observation."""
    return name.method, name.observation.removesuffix("+held")


def _panel(
    axes: Any, task: str, own: Mapping[Name, np.ndarray], known: Sequence[Reference]
) -> None:
    """The curves of a task, and numbers of others for the same methods and observations."""
    shown = {name: points for name, points in own.items() if name.task == task}
    keys = sorted({_color_key(name) for name in own})
    for name, points in shown.items():
        steps, median, low, high = points.T
        same = [other for other in shown if _color_key(other) == _color_key(name)]
        shown_name = name[1:] if len(same) > 1 else name[1:4]
        title = ", ".join(shown_name[name.actor == DEFAULT_ACTOR :])
        style = _STYLES[same.index(name) % len(_STYLES)]
        color = _COLORS[keys.index(_color_key(name))]
        axes.plot(steps / 1000, median, style, color=color, label=title)
        axes.fill_between(steps / 1000, low, high, color=color, alpha=0.2, linewidth=0)
    compared = (r for r in known if any(r.compares(name) for name in shown))
    numbers = [r for r in compared if r.bound == "is"]
    for r, style in zip(numbers, itertools.cycle(_DASHES), strict=False):
        title = f"others, {r.method} {r.observation}: {r.value:g}"
        axes.axhline(r.value, color="0.4", linewidth=0.8, linestyle=style, label=title)
    axes.set_title(task, fontsize="medium")
    axes.set_ylim(min(max(axes.get_ylim()[0], _LOWEST), 0.0), 1.05)
    axes.set_xlabel("env steps [1000]", fontsize="small")
    axes.set_ylabel("normalized performance", fontsize="small")
    axes.tick_params(labelsize="small")
    axes.spines[["top", "right"]].set_visible(False)
    beside = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0)}  # [panels]
    axes.legend(fontsize="small", frameon=False, borderaxespad=0.0, **beside)
