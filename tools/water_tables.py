"""What docs/reality.md shows of recorded water: docs/water_recordings.json.

`softgym-mj validate water FOLDER --out` wrote it.
"""

import json
import pathlib
from collections.abc import Callable
from typing import Any

from tools.pages import table

FILE = pathlib.Path(__file__).parent.parent / "docs" / "water_recordings.json"


def errors() -> str:
    """Errors [%] of each setting at two resolutions; those beyond their bound are bold."""
    rows = json.loads(FILE.read_text(encoding="utf-8"))["measurements"]
    settings = list(dict.fromkeys(row["setting"] for row in rows))
    lines = []
    for name, quantity in dict.fromkeys((row["experiment"], row["quantity"]) for row in rows):
        own = [row for row in rows if (row["experiment"], row["quantity"]) == (name, quantity)]
        cells = [_errors([row for row in own if row["setting"] == setting]) for setting in settings]
        bound = own[0]["bound"]
        layers = ", ".join(map(str, sorted({row["layers"] for row in own})))
        limit = "" if bound is None else f"{100 * bound:.0f}"
        lines.append(f"| {name} | {quantity} | {layers} | {limit} | {' | '.join(cells)} |")
    titles = " | ".join(settings)
    return table(f"| recording | off by, % | layers | bound | {titles} |", lines)


def _errors(rows: list[dict[str, Any]]) -> str:
    """Errors of a setting, from few to many layers."""
    cells = []
    for row in sorted(rows, key=lambda row: row["layers"]):
        text = f"{100 * row['error']:.1f}"
        if row["delay"] is not None:
            text += f" ({1e3 * row['delay']:.0f} ms)"
        beyond = row["bound"] is not None and abs(row["error"]) > row["bound"]
        cells.append(f"**{text}**" if beyond else text)
    return ", ".join(cells)


TABLES: dict[str, Callable[[], str]] = {"water_errors": errors}
