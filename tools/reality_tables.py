"""Tables of docs/reality.md, of what was measured: docs/rags.json and docs/shirts.json."""

import json
import pathlib
from collections.abc import Callable, Iterable
from typing import Any

from tools.pages import table

DOCS = pathlib.Path(__file__).parent.parent / "docs"

# What ran, by the engine's name in the file.
ENGINES = {
    "ours": "softgym_mj, published stretch",
    "ours_woven": "softgym_mj, stretch of 1 kN/m or more",
    "shell_10ms": "MuJoCo 3.17 flex, shell, 10 ms steps, 1 kN/m or more",
    "shell_2ms": "MuJoCo 3.17 flex, shell, 2 ms steps, 1 kN/m or more",
}
MUCH = 5.0  # [%] Of strain.

Row = dict[str, Any]


def rags() -> str:
    """Both primitives with all engines."""
    found = json.loads((DOCS / "rags.json").read_text())
    runs: list[Row] = found["runs"]
    rows = []
    for engine, title in ENGINES.items():
        for grams in sorted({run["grams_per_m2"] for run in runs if run["engine"] == engine}):
            some = [run for run in runs if (run["engine"], run["grams_per_m2"]) == (engine, grams)]
            rows.append(_row(title, f"{grams / 1e3:g}", some))
    fitted = [run for run in runs if run["engine"] == "fitted"]
    for run in fitted:
        title = f"MuJoCo 3.17 flex, fit of {run['fabric']}, {run['primitive']}"
        rows.append(_row(title, f"{run['grams_per_m2'] / 1e3:.3g}", [run]))
    head = (
        "| engine | kg/m^2 | runs | failures | strain over 5 % | strain, settling [%] "
        "| strain, moving [%] | lowest vertex [mm] | ms a step | times real time |"
    )
    return f"{table(head, rows)}\n\n{_on(found['machine'])}"


def fabrics() -> str:
    """Strain of each fabric with its published stretch and with that of a woven."""
    runs: list[Row] = json.loads((DOCS / "rags.json").read_text())["runs"]
    rows = []
    for name in dict.fromkeys(run["fabric"] for run in runs if run["engine"] == "ours"):
        cells = []
        for engine in ("ours", "ours_woven"):
            some = [run for run in runs if (run["engine"], run["fabric"]) == (engine, name)]
            cells += [
                f"{100 * max(run['strain_99_moving'] for run in some):.1f}",
                str(sum(bool(run["failures"]) for run in some)),
            ]
        rows.append(f"| `{name}` | {' | '.join(cells)} |")
    head = (
        "| fabric | published stretch: strain [%] | failures of 6 | 1 kN/m or more: strain [%] "
        "| failures of 6 |"
    )
    return table(head, rows)


def shirts() -> str:
    """A T-shirt in two hands."""
    found = json.loads((DOCS / "shirts.json").read_text())
    rows = []
    for run in found["runs"]:
        stretch = found["stretches"][run["stretch"]]
        cells = (
            f"{run['vertices']:,}",
            f"{stretch:,.0f}",
            run["action"],
            str(run["intersections"]),
            str(len(run["failures"])),
            f"{100 * run['strain_99']:.1f}",
            f"{1e3 * run['lowest_m']:.1f}",
            f"{run['milliseconds']:.1f}",
            f"{run['real_time_factor']:.2f}",
        )
        rows.append(f"| {' | '.join(cells)} |")
    head = (
        "| vertices | stretch [N/m] | action | intersections at the end | failures | strain [%] "
        "| lowest vertex [mm] | ms a step | times real time |"
    )
    return f"{table(head, rows)}\n\n{_on(found['machine'])}"


def _on(machine: Row) -> str:
    """What something was measured on, with the yardstick."""
    rate = machine["humanoid_mj_steps_per_second"]
    return f"{machine['processor']}; dm_control's humanoid makes {rate:,.0f} mj_steps/s on a core."


def _row(title: str, density: str, runs: list[Row]) -> str:
    """Of several runs: how many failed, the largest strains, the lowest vertex, means of times."""
    cells = (
        title,
        density,
        str(len(runs)),
        str(sum(bool(run["failures"]) for run in runs)),
        str(sum(_percent(run) > MUCH for run in runs)),
        _range(100 * run["strain_99_settling"] for run in runs),
        _range(
            100 * run["strain_99_moving"] for run in runs if run["strain_99_moving"] is not None
        ),
        f"{1e3 * min(run['lowest_m'] for run in runs):.1f}",
        f"{sum(run['milliseconds'] for run in runs) / len(runs):.2f}",
        f"{sum(run['real_time_factor'] for run in runs) / len(runs):.2f}",
    )
    return f"| {' | '.join(cells)} |"


def _percent(run: Row) -> float:
    """The largest 99th percentile of strain [%], settling included; infinite if it broke off."""
    parts = [run["strain_99_settling"], run["strain_99_moving"]]
    return 100 * max(parts) if None not in parts else float("inf")


def _range(values: Iterable[float]) -> str:
    low, *_, high = sorted([*values] * 2) or ["never", "never"]
    return f"{low:.1f}..{high:.1f}" if low != high else f"{low:.1f}"


TABLES: dict[str, Callable[[], str]] = {"rags": rags, "rag fabrics": fabrics, "shirts": shirts}
