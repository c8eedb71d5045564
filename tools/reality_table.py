"""What README.md shows of recordings: docs/{rope,cloth,water}_recordings.json."""

import json
import pathlib
import re
from collections.abc import Sequence
from typing import Any

from tools.pages import table

DOCS = pathlib.Path(__file__).parent.parent / "docs"
_FRONTS = "koshizuka_oka", "martin_moyce_29", "martin_moyce_57"
_TANKS = "faltinsen", "bouscasse"
_BOX = ("spheric_2",)


def summary() -> str:
    """Errors of baselines, of one guess and of identified properties, as ranges."""
    rope, cloth = ({row["solver"]: [] for row in _rows(name)} for name in ("rope", "cloth"))
    for name, errors in (("rope", rope), ("cloth", cloth)):
        for row in _rows(name):
            errors[row["solver"]].append(1e3 * row["error"])
    level = _water(_BOX, "H.", "level water")
    lines = [
        f"| five cables that two robots move, 14 recordings each, 5 s | mean absolute error [mm] "
        f"| {_range(rope['nothing moves'])} | {_range(rope['rope, assumed'])} "
        f"| {_range(rope['rope, identified'])} |",
        f"| a cloth that a robot swings, 10 recordings of 13 s | mean distance of nodes [mm] "
        f"| {_range(cloth['nothing moves'])} | {_range(cloth['cloth, assumed'])} "
        f"| {_range(cloth['cloth, identified'])} |",
        f"| a dam break onto a box, {len(level)} gauges, 7 s | height, rms over depth [%] "
        f"| {_range(level)} | {_range(_water(_BOX, 'H.'))} | |",
        f"| {len(_FRONTS)} dam breaks, up to the wall | position of the front, rms [%] "
        f"| | {_range(_water(_FRONTS, 'front'))} | |",
        f"| the same, without the delay of the gate's release | position of the front, rms [%] "
        f"| | {_range(_water(_FRONTS, 'front .*'))} | |",
        f"| {len(_TANKS)} sloshing tanks | period, amplitude [%] "
        f"| | {_range(_water(_TANKS, 'period'))}, {_range(_water(_TANKS, 'amplitude'))} | |",
    ]
    titles = "recordings | error | nothing moves | one guess | identified on other recordings"
    return table(f"| {titles} |", lines)


def _water(
    experiments: Sequence[str], quantity: str, solution: str = "water without wall friction"
) -> list[float]:
    """Errors [%] whose quantity matches a pattern, of the most particles in each experiment."""
    rows = [row for row in _rows("water") if row["solution"] == solution]
    most = {row["experiment"]: row["cells"] for row in rows}  # Their numbers increase.
    return [
        100 * abs(row["error"]["value"])
        for row in rows
        if row["experiment"] in experiments
        and row["cells"] == most[row["experiment"]]
        and re.fullmatch(quantity, row["error"]["quantity"])
    ]


def recorded(material: str) -> dict[str, Any]:
    """Returns docs/MATERIAL_recordings.json, which `softgym-mj validate MATERIAL` wrote."""
    return json.loads((DOCS / f"{material}_recordings.json").read_text(encoding="utf-8"))


def _rows(material: str) -> list[dict[str, Any]]:
    return recorded(material)["measurements"]


def _range(values: list[float]) -> str:
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return low if low == high else f"{low} to {high}"
