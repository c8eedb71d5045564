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
_PLAIN, _TASK = "water without wall friction", "water of TransportWater"


def summary() -> str:
    """Errors of baselines, of one guess, of identified properties and of the tasks' water."""
    rope = _millimeters("rope", "free_error")
    cloth = _millimeters("cloth", "error")
    lines = [
        _line("five cables that two robots move, 14 recordings each, 5 s",
              "free markers, mean per coordinate [mm]", rope["nothing moves"],
              rope["displacement of the ends, interpolated"], rope["rope, assumed"],
              rope["rope, identified"], ""),
        _line("a cloth that a robot swings, 10 recordings of 13 s", "nodes, mean distance [mm]",
              cloth["nothing moves"], cloth["rigid sheet on the tool"], cloth["cloth, assumed"],
              cloth["cloth, identified"], ""),
        _line("a dam break onto a box, 4 gauges, 7 s", "height, rms over depth [%]",
              _water(_BOX, "H.", "level water"), "", *_waters(_BOX, "H.")),
        _line(f"{len(_FRONTS)} dam breaks, up to the wall", "position of the front, rms [%]",
              "", "", *_waters(_FRONTS, "front")),
        _line("the same, shifted by the release delay that fits best",
              "position of the front, rms [%]", "", "", *_waters(_FRONTS, "front .*")),
        *(
            _line(f"{len(_TANKS)} sloshing tanks", f"{quantity} [%]", "",
                  _water(_TANKS, quantity, "linear waves"), *_waters(_TANKS, quantity))
            for quantity in ("period", "amplitude")
        ),
    ]  # fmt: skip
    titles = (
        "recordings", "error", "nothing moves", "simple model", "one guess",
        "identified on other recordings", "water of the tasks",
    )  # fmt: skip
    return table(f"| {' | '.join(titles)} |", lines)


def _line(recordings: str, error: str, *cells: str) -> str:
    return f"| {recordings} | {error} | {' | '.join(cells)} |"


def _millimeters(material: str, name: str) -> dict[str, str]:
    """Errors of each solver [mm], as ranges."""
    errors: dict[str, list[float]] = {}
    for row in recorded(material)["measurements"]:
        errors.setdefault(row["solver"], []).append(1e3 * row[name])
    return {solver: _range(values) for solver, values in errors.items()}


def _waters(experiments: Sequence[str], quantity: str) -> list[str]:
    """Cells of one guess, of nothing that was identified, and of the tasks' water."""
    plain, task = (_water(experiments, quantity, solution) for solution in (_PLAIN, _TASK))
    return [plain, "", task]


def _water(experiments: Sequence[str], quantity: str, solution: str) -> str:
    """Errors [%] whose quantity matches a pattern, of the most particles in each experiment."""
    rows = [row for row in recorded("water")["measurements"] if row["solution"] == solution]
    most = {row["experiment"]: row["cells"] for row in rows}  # Their numbers increase.
    return _range(
        [
            100 * abs(row["error"]["value"])
            for row in rows
            if row["experiment"] in experiments
            and row["cells"] == most[row["experiment"]]
            and re.fullmatch(quantity, row["error"]["quantity"])
        ]
    )


def recorded(material: str) -> dict[str, Any]:
    """Returns docs/MATERIAL_recordings.json, which `softgym-mj validate MATERIAL` wrote."""
    return json.loads((DOCS / f"{material}_recordings.json").read_text(encoding="utf-8"))


def _range(values: list[float]) -> str:
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return low if low == high else f"{low} to {high}"
