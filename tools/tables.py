"""Writes tables into README.md and docs: of the tasks, and of what was measured.

That is docs/experts.json, docs/throughput.json and docs/results.
"""

import json
import pathlib
import re

import softgym_mj
from benchmarks import experts
from softgym_mj.evaluation import comparison, plots
from softgym_mj.variations.randomization import Parameter

ROOT = pathlib.Path(__file__).parent.parent
DOCS = ROOT / "docs"
README, DOMAIN, ROBOTS, VALIDATION, RESULTS = (
    ROOT / "README.md",
    DOCS / "domain.md",
    DOCS / "robots.md",
    DOCS / "validation.md",
    DOCS / "results.md",
)
PAGES = (README, DOMAIN, ROBOTS, VALIDATION, RESULTS)
POLICIES = ("zero", "random", "scripted", "cem", "icem")


def cells(actors: dict[str, dict[str, float]]) -> list[str]:
    """Mean and smallest score with each actor."""
    scores = [actors[actor].values() for actor in experts.ACTORS]
    return [f"{sum(values) / len(values):.2f} ({min(values):.2f})" for values in scores]


def replaced(text: str, pattern: str, by: str) -> str:
    """The text with its one match replaced."""
    text, count = re.subn(pattern, lambda match: match.expand(by), text)
    if count != 1:
        raise ValueError(f"{pattern} is {count} times in the page; expected once")
    return text


def table(head: str, rows: list[str]) -> str:
    """Markdown of a table with this first line."""
    return "\n".join([head, "|---" * (head.count("|") - 1) + "|", *rows])


def with_table(text: str, new: str) -> str:
    """A page with its table of the same first line replaced."""
    head = re.escape(new.splitlines()[0])
    return replaced(text, rf"{head}\n\|---.*(\n\|.*)*", new.replace("\\", r"\\"))


def env_steps(result: dict) -> int:
    """That a planner makes in an episode."""
    planning, steps = result["planning"], softgym_mj.TASKS[result["task"]].horizon
    return -(-steps // planning["replan_every"]) * planning["budget"]


def budgets(results: list[dict]) -> str:
    """What the planners may spend."""
    rows = []
    for task in softgym_mj.TASKS:
        (result,) = (r for r in results if (r["task"], r["policy"]) == (task, "cem"))
        keys = ("horizon", "budget", "iterations", "replan_every")
        numbers = [result["planning"][key] for key in keys] + [env_steps(result)]
        rows.append(f"| `{task}` | {' | '.join(map(str, numbers))} |")
    titles = "horizon | env steps for a decision | iterations | a plan is executed for"
    return table(f"| task | {titles} | env steps of an episode |", rows)


def horizons(results: list[dict]) -> str:
    """The planning horizons compared."""
    rows = []
    for r in sorted(results, key=lambda r: (r["task"], r["planning"]["horizon"])):
        score = f"{r['summary']['mean']:.2f} ({r['summary']['min']:.2f})"
        rows.append(f"| `{r['task']}` | {r['planning']['horizon']} | {score} | {env_steps(r)} |")
    return table("| task | planning horizon | mean (smallest) | env steps of an episode |", rows)


def read(ablations: bool) -> list[dict]:
    """The results of docs/results, by task and policy: those of the horizons, or the others."""
    files = sorted((DOCS / "results").glob("*.json"))
    found = comparison.read_results([f for f in files if ("ablation" in f.name) == ablations])
    tasks = list(softgym_mj.TASKS)
    return sorted(found, key=lambda r: (tasks.index(r["task"]), POLICIES.index(r["policy"])))


def overview(scores: experts.Scores) -> str:
    """The README's tables of the tasks: pictures, goals, scores, speeds."""
    rates = json.loads((DOCS / "throughput.json").read_text())["tasks"]
    lines = []
    every = list(softgym_mj.TASKS)
    for names in (every[i : i + 5] for i in range(0, len(every), 5)):
        lines.append(f"| {' | '.join(f'![{n}](docs/gifs/{n}.gif)' for n in names)} |")
        lines.append(f"| {' | '.join(f'`{n}`' for n in names)} |")
    lines.insert(1, "|" + ":-:|" * 5)
    rows = []
    for name, record in softgym_mj.TASKS.items():
        score = cells(scores[name])[0] if name in scores else "not yet played"
        rate = f"{rates[name]['env_steps_per_second']:.0f}" if name in rates else "not yet measured"
        page = f"[`{name}`](docs/tasks/{name}.md)"
        rows.append(f"| {page} | {record.tags[0]} | {record.summary} | {score} | {rate} |")
    head = "| task | | goal | scripted expert | env steps/s, one core |"
    return "\n".join([*lines, "", table(head, rows)])


def parameters() -> str:
    """The domain parameters of all tasks, and which tasks have them."""
    tasks: dict[Parameter, list[str]] = {}
    for name, record in softgym_mj.TASKS.items():
        for parameter in record.build().domain.parameters:
            tasks.setdefault(parameter, []).append(name)
    groups = {"all": list(softgym_mj.TASKS)}
    for kind in ("cloth", "rope", "water"):
        groups[kind] = [name for name, record in softgym_mj.TASKS.items() if kind in record.tags]
    rows = []
    for p, names in tasks.items():
        label = next((group for group, members in groups.items() if members == names), None)
        usual, valid = (f"{low:.3g} to {high:.3g}" for low, high in (p.usual, p.valid))
        label = label or ", ".join(f"`{name}`" for name in names)
        row = label, f"`{p.name}`", p.unit, f"{p.nominal:.3g}", usual, valid, p.summary
        rows.append(f"| {' | '.join(row)} |".replace("|  |", "| |"))
    return table("| task | parameter | unit | nominal | usual | valid | what it is |", rows)


def between(text: str, name: str, new: str) -> str:
    """A page with what is between its comments `name` and `/name` replaced."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    inner = new.replace("\\", r"\\")
    return replaced(text, rf"{start}\n[\s\S]*?{end}", f"{start}\n{inner}\n{end}")


def pages() -> dict[pathlib.Path, str]:
    """The pages as they should be."""
    scores: experts.Scores = json.loads((DOCS / "experts.json").read_text())
    texts = {path: path.read_text() for path in PAGES}
    for task, actors in scores.items():
        found = cells(actors)
        row = rf"(\| `{task}` \|[^|]*\|) .* \|\n"
        texts[ROBOTS] = replaced(texts[ROBOTS], row, rf"\1 {' | '.join(found)} |\n")
    texts[README] = between(texts[README], "tasks", overview(scores))
    texts[DOMAIN] = with_table(texts[DOMAIN], parameters())
    texts[VALIDATION] = with_table(texts[VALIDATION], experts.table(scores))
    results = read(False)
    for new in (comparison.markdown(results).rstrip(), budgets(results), horizons(read(True))):
        texts[RESULTS] = with_table(texts[RESULTS], new)
    return texts


def main() -> None:
    for path, text in pages().items():
        path.write_text(text)
    plots.bars(read(False), DOCS / "results.png")
    plots.curves(read(True), "horizon", DOCS / "horizon.png")


if __name__ == "__main__":
    main()
