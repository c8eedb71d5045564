"""Tables of what fabrics measure in the lab: docs/lab.csv, of `softgym-mj validate lab`."""

import csv
import pathlib
from collections.abc import Callable, Iterable

from tools.pages import table

FILE = pathlib.Path(__file__).parent.parent / "docs" / "lab.csv"
Row = dict[str, str]

MESHES = {
    "along and across": ("grid_0", "grid_90"),
    "45°": ("grid_45",),
    "no grid": ("unstructured",),
}
STRIPS = {"cantilever": "true size", "cantilever_sheet": "3 cm"}
OTHERS = ("hanging", "hanging_sheet", "falling", "swinging", "tilting", "sliding")


def measured() -> list[Row]:
    """All rows of the file."""
    with FILE.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def errors(rows: Iterable[Row]) -> str:
    """From the least to the largest error [%]; one number if there is one row."""
    found = sorted(100.0 * float(row["error"]) for row in rows)
    ends = [f"{value:+.1f}".replace("-0.0", "0.0").replace("+0.0", "0.0") for value in found]
    return ends[0] if len(ends) == 1 else f"{ends[0]} to {ends[-1]}"


def strips() -> str:
    """Errors of bending stiffness by fabric, strip and mesh."""
    rows = measured()
    lines = []
    for fabric in dict.fromkeys(row["fabric"] for row in rows):
        cells = [
            errors(
                row for row in rows
                if (row["fabric"], row["experiment"]) == (fabric, strip) and row["mesh"] in meshes
            )
            for strip in STRIPS
            for meshes in MESHES.values()
        ]  # fmt: skip
        lines.append(f"| `{fabric}` | {' | '.join(cells)} |")
    titles = [f"{mesh}, {strip}" for strip in STRIPS.values() for mesh in MESHES]
    return table(f"| off by, % | {' | '.join(titles)} |", lines)


def others() -> str:
    """Errors of the other experiments by fabric."""
    rows = measured()
    lines = []
    for fabric in dict.fromkeys(row["fabric"] for row in rows):
        own = [row for row in rows if row["fabric"] == fabric]
        cells = [errors(row for row in own if row["experiment"] == name) for name in OTHERS]
        lines.append(f"| `{fabric}` | {' | '.join(cells)} |")
    titles = (
        "stretch of a hanging strip", "the same in steps of tasks", "speed of fall",
        "amplitude after three swings", "static friction", "sliding friction",
    )  # fmt: skip
    return table(f"| off by, % | {' | '.join(titles)} |", lines)


def kept() -> str:
    """Table of the number of measurements within their bounds, by experiment and mesh."""
    rows = measured()
    lines = []
    for name in ("cantilever", "cantilever_sheet", *OTHERS):
        of = [row for row in rows if row["experiment"] == name]
        for title, meshes in MESHES.items() if name in STRIPS else (("", ("grid_0",)),):
            some = [row for row in of if row["mesh"] in meshes]
            passed = sum(row["passed"] == "True" for row in some)
            bound = f"{100 * float(some[0]['bound']):.0f}"
            label = f"`{name}`{', ' if title else ''}{title}"
            lines.append(f"| {label} | {bound} | {passed} of {len(some)} | {errors(some)} |")
    return table("| experiment | bound, % | within it | off by, % |", lines)


TABLES: dict[str, Callable[[], str]] = {"strips": strips, "lab": others}  # In docs/reality.md.
