"""What docs/reality.md shows of recorded water: docs/water_recordings.json.

`softgym-mj validate water --out` wrote it.
"""

from collections.abc import Callable
from typing import Any

from tools.pages import table
from tools.reality_table import recorded


def _cell(error: dict[str, Any]) -> str:
    """Error in percent: with a sign unless it is a root mean square, bold beyond its bound."""
    signed = error["quantity"] in ("period", "amplitude")
    text = f"{100 * error['value']:{'+.1f' if signed else '.1f'}}"
    bound = error["bound"]
    return text if bound is None or abs(error["value"]) <= bound else f"**{text}**"


def _line(experiment: str, solution: str, rows: list[dict[str, Any]]) -> str:
    """Errors of a solution of an experiment, with one number of particles."""
    errors = [row["error"] for row in rows]
    bounds = ", ".join(f"{100 * e['bound']:.0f}" if e["bound"] else "none" for e in errors)
    simulated = rows[0]["cells"] > 0
    numbers = (
        ", ".join(error["quantity"] for error in errors),
        bounds,
        solution,
        f"{rows[0]['particles']:,}" if simulated else "",
        ", ".join(map(_cell, errors)),
        f"{rows[0]['seconds']:.1f}" if simulated else "",
    )
    return f"| `{experiment}` | {' | '.join(numbers)} |"


def errors() -> str:
    """Errors of all solutions in percent; those beyond their bounds are bold."""
    rows = recorded("water")["measurements"]
    groups: dict[tuple[str, str, int], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["experiment"], row["solution"], row["cells"]), []).append(row)
    lines = [_line(name, solution, own) for (name, solution, _), own in groups.items()]
    return table(
        "| experiment | compared | bound, % | solution | particles | error, % | CPU s |", lines
    )


TABLES: dict[str, Callable[[], str]] = {"water_errors": errors}
