"""What docs/reality.md shows of solvers of slender rods: docs/rods.json (benchmarks/rods.py)."""

import json
import pathlib
from collections.abc import Callable
from typing import Any

from tools.pages import table

FILE = pathlib.Path(__file__).parent.parent / "docs" / "rods.json"
OWN = "softgym_mj"
DEFAULT = "default"  # Variant with the default of each parameter.
SOLVERS = {OWN: "rope of this package", "mujoco": "MuJoCo's cable", "pyelastica": "PyElastica"}
# What each experiment is judged by: metric or observation, name, factor, unit, bound of its
# magnitude. The benchmark has no bounds. Errors are relative, those of shapes to the length.
JUDGED: dict[str, list[tuple[str, str, float, str, float]]] = {
    "cantilever": [("tip_deflection_error", "deflection", 100.0, "%", 5.0)],
    "catenary": [
        ("shape_error", "shape", 100.0, "%", 5.0),
        ("sag_error", "sag", 100.0, "%", 5.0),
    ],
    "pendulum": [
        ("period_error", "period", 100.0, "%", 5.0),
        ("amplitude_change", "amplitude", 100.0, "%", 5.0),
    ],
    "twist": [("critical_twist_error", "critical twist", 100.0, "%", 5.0)],
    "crossing": [
        ("shape_error", "shape", 100.0, "%", 5.0),
        ("lift_error", "lift", 100.0, "%", 5.0),
    ],
    "capstan": [("slide", "slip", 1e3, "mm", 1.0)],
    "pile": [("max_rod_overlap", "overlap", 100.0, "% of the radius", 10.0)],
}
# Parameters of the capstan with which the rope slides off, by theory.
_SLIDING = {"overhang=1.1", "overhang=1.5"}


def results() -> list[dict[str, Any]]:
    """Results of all solvers."""
    return json.loads(FILE.read_text(encoding="utf-8"))["results"]


def figures(result: dict[str, Any]) -> str:
    """Figures of a result that an experiment is judged by; those that fail are bold."""
    if result["outcome"] == "unsupported":
        return f"unsupported: {', '.join(result['missing'])}"
    if result["outcome"] == "diverged":
        return "**diverged**"
    cells = [f"{name} {cell if good else f'**{cell}**'}" for name, cell, good in _judged(result)]
    return ", ".join(cells)


def passes(result: dict[str, Any]) -> bool:
    """Whether an experiment was completed and its figures are within their bounds."""
    return result["outcome"] == "completed" and all(good for _, _, good in _judged(result))


def _judged(result: dict[str, Any]) -> list[tuple[str, str, bool]]:
    """Name, figure with its unit and whether it is good, of each figure of a result."""
    values = result["metrics"] | result["observations"]
    slides = result["variant"] in _SLIDING
    found = []
    for key, name, factor, unit, bound in JUDGED[result["experiment"]]:
        value = values[key]
        if value is None:
            found.append((name, "none", False))
        else:
            figure = factor * abs(value)
            found.append((name, f"{_short(figure)} {unit}", (figure <= bound) != slides))
    return found


def _short(number: float) -> str:
    return f"{number:.0f}" if number >= 100.0 else f"{number:.2g}"


def comparison() -> str:
    """Default variant of each experiment: whether it passes, figures and seconds by solver."""
    found = {(r["experiment"], r["solver"]): r for r in results() if r["variant"] == DEFAULT}
    lines = []
    for experiment in JUDGED:
        cells = ["passed" if passes(found[experiment, OWN]) else "**failed**"]
        for solver in SOLVERS:
            result = found.get((experiment, solver))
            took = result and result["wall_time"]
            seconds = f" ({_short(took)} s)" if took else ""
            cells.append(f"{figures(result)}{seconds}" if result else "")
        lines.append(f"| `{experiment}` | {' | '.join(cells)} |")
    return table(f"| experiment | result | {' | '.join(SOLVERS.values())} |", lines)


def variants() -> str:
    """Number of variants that this package's rope passes, and the figures of the others."""
    own = [r for r in results() if r["solver"] == OWN and r["variant"] != DEFAULT]
    lines = []
    for experiment in JUDGED:
        runs = [r for r in own if r["experiment"] == experiment]
        failed = [f"`{r['variant']}`: {figures(r)}" for r in runs if not passes(r)]
        passed = f"{len(runs) - len(failed)} of {len(runs)}"
        lines.append(f"| `{experiment}` | {passed} | {'; '.join(failed)} |")
    return table("| experiment | variants passed | the others |", lines)


TABLES: dict[str, Callable[[], str]] = {"rod_comparison": comparison, "rod_variants": variants}
