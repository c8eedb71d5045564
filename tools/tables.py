"""Writes tables into README.md and docs: of the tasks, and of what was measured.

That is docs/experts.json, docs/throughput.json, docs/vector.json, docs/fluid.json,
docs/hidden.json, those of tools/gpu_tables.py, docs/lerobot.json, docs/lab.csv,
docs/rope_recordings.json, docs/cloth_recordings.json, docs/water_recordings.json, and docs/results.
"""

import json
import pathlib
import statistics
from collections.abc import Callable

from benchmarks import experts
from softgym_mj.evaluation import comparison, plots
from softgym_mj.learning.results import planned_env_steps
from softgym_mj.policies.exported import has_images
from softgym_mj.registry import DOMAIN as SOFTGYM
from softgym_mj.registry import PLUS, TASKS, task_names
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.storage.files import read_json
from softgym_mj.variations.randomization import Parameter
from tools import (
    cloth_tables,
    gallery,
    gpu_tables,
    grasp_table,
    lab_tables,
    learned,
    lerobot_table,
    presets,
    published_commands,
    reality_table,
    rope_tables,
    settings_table,
    water_tables,
)
from tools.pages import between, table, with_table

ROOT = pathlib.Path(__file__).parent.parent
DOCS = ROOT / "docs"
POLICIES = ("zero", "random", "scripted", "cem", "icem")


def score(played: experts.Played) -> str:
    """Mean and smallest of scores."""
    values = played["scores"].values()
    return f"{statistics.mean(values):.2f} ({min(values):.2f})"


def budgets(results: list[dict]) -> str:
    """Budgets of the planners."""
    rows = []
    for result in (r for r in results if r["policy"] == "cem"):
        keys = ("horizon", "budget", "iterations", "replan_every")
        numbers = [result["planning"][key] for key in keys] + [planned_env_steps(result)]
        rows.append(f"| `{result['task']}` | {' | '.join(map(str, numbers))} |")
    titles = "horizon | env steps for a decision | iterations | a plan is executed for"
    return table(f"| task | {titles} | env steps of an episode |", rows)


def horizons(results: list[dict]) -> str:
    """The planning horizons compared."""
    rows = []
    for r in sorted(results, key=lambda r: (r["task"], r["planning"]["horizon"])):
        low, high = r["summary"]["percentile_25"], r["summary"]["percentile_75"]
        score = f"{r['summary']['median']:.2f} ({low:.2f} to {high:.2f})"
        steps = planned_env_steps(r)
        rows.append(f"| `{r['task']}` | {r['planning']['horizon']} | {score} | {steps} |")
    return table("| task | planning horizon | median (quartiles) | env steps of an episode |", rows)


def read(ablations: bool) -> list[dict]:
    """The results of docs/results, by task and policy: those of the horizons, or the others."""
    files = sorted((DOCS / "results").glob("*.json"))
    found = comparison.read_results([f for f in files if ("ablation" in f.name) == ablations])
    tasks = list(TASKS)
    return sorted(found, key=lambda r: (tasks.index(r["task"]), POLICIES.index(r["policy"])))


def measured(name: str) -> dict:
    """A file of docs that a benchmark wrote."""
    return json.loads((DOCS / f"{name}.json").read_text())


def on(machine: dict) -> str:
    """Machine of a measurement, with its reference rate."""
    rate = machine["humanoid_mj_steps_per_second"]
    return f"Core: {machine['processor']}, {rate:,.0f} mj_steps/s of dm_control's humanoid."


def materials() -> str:
    """Speeds by material, from the least to the most of its tasks."""
    found = measured("throughput")
    figures: dict[str, tuple[Callable[[dict], float], str]] = {
        "env steps/s": (lambda rates: rates["env_steps_per_second"], ",.0f"),
        "128 x 128 images/s": (lambda rates: rates["images_128_per_second"], ".0f"),
    }
    rows = []
    for title, (figure, form) in figures.items():
        row = [title]
        for kind in ("rope", "cloth", "water"):
            own = [figure(r) for name, r in found["tasks"].items() if kind in TASKS[name].tags]
            row.append(f"{min(own):{form}} to {max(own):{form}}")
        rows.append(f"| {' | '.join(row)} |")
    return f"{table('| | rope | cloth | water |', rows)}\n\n{on(found['machine'])}"


def arm_speeds() -> str:
    """Speeds with pickers or cups, and with arms by their shares of these."""
    found, rows = measured("throughput"), []
    for name in (task for task in TASKS if task in found["tasks"]):
        own = found["tasks"][name]
        rate = own["env_steps_per_second"]
        rates = (rate, *(rate * own["arms"][arm] for arm in own["arms"]))
        rows.append(f"| `{name}` | {' | '.join(f'{r:,.0f}' for r in rates)} |")
    titles = " | ".join(f"`{arm}`" for arm in own["arms"])
    head = f"| task, env steps/s | abstract actor | {titles} |"
    return f"{table(head, rows)}\n\n{on(found['machine'])}"


def water() -> str:
    """CPU time of a step of water, and of a particle's substep by three codes."""
    found, rows = measured("fluid"), []
    for count, own in found["columns"].items():
        rest, shaken = own["rest"], own["shaken"]
        steps = (f"{costs['simd_ms_per_step']:.2f} ms" for costs in (rest, shaken))
        codes = ("simd", "scalar", "warp")
        costs = (f"{shaken[f'{code}_ns_per_particle_substep']:,.0f} ns" for code in codes)
        size = f"{int(count):,} x {shaken['substeps']}"
        rows.append(f"| {' | '.join((size, *steps, *costs))} |")
    titles = "at rest | shaken | shaken, a particle's substep | the same without AVX2"
    head = f"| particles x substeps | {titles} | warp's SPH example |"
    return f"{table(head, rows)}\n\n{on(found['machine'])}"


def processes() -> str:
    """Throughput of vector environments in one and two processes."""
    found, rows = measured("vector"), []
    for one, two in zip(found["rows"][::2], found["rows"][1::2], strict=True):
        rates = " | ".join(f"{row['env_steps_per_second']:,.0f}" for row in (one, two))
        rows.append(f"| `{one['task']}` | `{one['observation']}` | {rates} | {two['gain']:.2f} |")
    head = "| task | observation | one process, env steps/s | two | gain |"
    return f"{table(head, rows)}\n\n{on(found['machine'])}"


def overview(scores: experts.Scores) -> str:
    """The README's table of SoftGym's tasks: goals, scores, speeds."""
    rates, gpu = measured("throughput")["tasks"], measured("gpu")
    rows = []
    for name in task_names(SOFTGYM):
        record = TASKS[name]
        played = score(scores[name]["default"]) if name in scores else "not yet played"
        own = rates.get(name)
        rate = f"{own['env_steps_per_second']:,.0f}" if own else "not yet measured"
        page = f"[`{name}`](docs/tasks/{name}.md)"
        thousand = gpu["rates"].get(name, {}).get("1056")
        fast = f"{thousand['env_steps_per_s']:,.0f}" if thousand else "not yet measured"
        success = f"{record.resolve().success:g}"
        row = page, record.tags[0], record.summary, success, played, rate, fast
        rows.append(f"| {' | '.join(row)} |")
    card = gpu["machine"]["gpu"].split()[1]  # "NVIDIA H100 80GB HBM3" is an H100.
    titles = "level | goal | success at | scripted expert | env steps/s, one core"
    return table(f"| task | {titles} | one {card} |", rows)


def beyond(scores: experts.Scores) -> str:
    """The table of the tasks beyond SoftGym: goals and scores."""
    rows = []
    for name in task_names(PLUS):
        level, material = TASKS[name].tags
        played = [score(scores[name][actor]) for actor in ("default", "franka")]
        record, page = TASKS[name], f"[`{name}`](tasks/{name}.md)"
        success = f"{record.resolve().success:g}"
        row = page, level, material, record.summary, success, *played
        rows.append(f"| {' | '.join(row)} |")
    titles = "level | material | goal | success at | expert, pickers | expert, Franka"
    return table(f"| task | {titles} |", rows)


def hidden(scores: experts.Scores) -> str:
    """Scores of experts and published policies on usual and hidden categories."""
    rows = []
    for task, policies in measured("hidden").items():
        for name, own in policies.items():
            usual, label = score(scores[task]["default"]), "expert"
            if name != "scripted":
                card = read_json(learned.RESULTS / "policies" / f"{name}.json")
                seed = card["policy"]["seed"]
                (last,) = (r for r in card["last"] if (r["seed"], r["split"]) == (seed, "evaluate"))
                sees_images = has_images(card["training"]["observation"])
                label = "from images" if sees_images else "from states"
                usual = f"{last['normalized_performance']:.2f}"
            mean, least, number = own["mean"], own["min"], own["episodes"]
            rows.append(f"| `{task}` | {label} | {usual} | {mean:.2f} ({least:.2f}) | {number} |")
    return table("| task | policy | usual category | hidden category | episodes |", rows)


def parameters() -> str:
    """The domain parameters of all tasks, and which tasks have them."""
    tasks: dict[Parameter, list[str]] = {}
    for name, record in TASKS.items():
        for parameter in record.build().domain.parameters:
            tasks.setdefault(parameter, []).append(name)
    groups = {"all": list(TASKS)}
    for kind in ("cloth", "rope", "water"):
        groups[kind] = [name for name, record in TASKS.items() if kind in record.tags]
    rows = []
    for p, names in tasks.items():
        label = next((group for group, members in groups.items() if members == names), None)
        usual, valid = (f"{_short(low)} to {_short(high)}" for low, high in (p.usual, p.valid))
        label = label or ", ".join(f"`{name}`" for name in names)
        row = label, f"`{p.name}`", p.kind, p.unit, _short(p.nominal), usual, valid, p.summary
        rows.append(f"| {' | '.join(row)} |".replace("|  |", "| |"))
    return table("| task | parameter | kind | unit | nominal | usual | valid | what it is |", rows)


def _short(value: float) -> str:
    """Returns a number with three digits, or all before the point."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def stills() -> str:
    """Pictures of all tasks with every kind of actor."""
    rows = []
    for name in task_names(SOFTGYM):
        shown = (f"![{name}, {actor}](gallery/{name}-{actor}.jpg)" for actor in gallery.ACTORS)
        rows.append(f"| `{name}` | {' | '.join(shown)} |")
    return table(f"| task | abstract actor | {' | '.join(f'`{arm}`' for arm in ARMS)} |", rows)


def pages() -> dict[pathlib.Path, str]:
    """Returns the text of each page with current tables."""
    scores: experts.Scores = measured("experts")
    named: tuple[tuple[pathlib.Path, dict[str, Callable[[], str]]], ...] = (
        (ROOT / "README.md", {"learned": learned.summary,
                              "tasks": lambda: overview(scores),
                              "reality": reality_table.summary}),
        (DOCS / "robots.md", {"speed": arm_speeds}),
        (DOCS / "softgym_plus.md", {"tasks": lambda: beyond(scores),
                                     "hidden": lambda: hidden(scores)}),
        (DOCS / "gpu.md", {"speed": materials, "processes": processes, **gpu_tables.RATES}),
        (DOCS / "gpu_kernels.md", {**gpu_tables.DETAILS}),
        (DOCS / "pictures.md", {"gallery": stills}),
        (DOCS / "reality.md", {**lab_tables.TABLES, **rope_tables.TABLES, **cloth_tables.TABLES,
                               **water_tables.TABLES}),
        (DOCS / "physics.md", {"lab": lab_tables.kept, "water": water}),
        (DOCS / "learning.md", {"presets": presets.presets, "settings": settings_table.sac}),
        (DOCS / "custom_tasks.md", {"grasps": grasp_table.grasps}),
        (DOCS / "validation.md", {"experts": lambda: experts.table(scores)}),
        (DOCS / "commands.md", {"commands": published_commands.commands}),
        (DOCS / "results.md", {"overview": learned.overview, "learned": learned.results,
                               "lerobot": lerobot_table.scores, "others": learned.others}),
    )  # fmt: skip
    texts = {}
    for path, tables in named:
        text = path.read_text()
        for name, of in tables.items():
            text = between(text, name, of())
        texts[path] = text
    results = read(False)
    domain = DOCS / "domain.md"
    texts[domain] = with_table(domain.read_text(), parameters())
    for new in (comparison.markdown(results).rstrip(), budgets(results), horizons(read(True))):
        texts[DOCS / "results.md"] = with_table(texts[DOCS / "results.md"], new)
    return texts


def main() -> None:
    for path, text in pages().items():
        path.write_text(text)
    plots.bars(read(False), DOCS / "results.png")
    plots.curves(read(True), DOCS / "horizon.png")
    learned.draw(learned.rows(), learned.references(), learned.FIGURE)


if __name__ == "__main__":
    main()
