"""Writes recordings of water in the layouts of the published ones."""

import pathlib
from collections.abc import Mapping

import numpy as np

from softgym_mj.reality.water.recordings import SPHERIC

HEADER = "Time (s) " + " ".join(
    [*(f"P{i} (Pa)" for i in range(1, 9)), *(f"H{i} (m)" for i in range(1, 5))]
)


def write_tables(
    folder: pathlib.Path, file: str, tables: Mapping[str, np.ndarray], code: str = ""
) -> None:
    """Writes tables (n, 2) as text that a Python file assigns to names, before some code."""
    lines = ['"""Experimental data."""', "import numpy as np", ""]
    for name, table in tables.items():
        rows = "\n".join(f"{t!r}\t{value!r}" for t, value in table.tolist())
        lines.append(f'{name} = u"""\n{rows}\n\n"""')
    (folder / file).write_text("\n".join([*lines, code]))


def write_spheric(folder: pathlib.Path, times: np.ndarray, heights: np.ndarray) -> None:
    """Writes heights (n, 4) [m] at times (n,) [s], and pressures of 0."""
    rows = np.column_stack([times, np.zeros((len(times), 8)), heights])
    lines = [" ".join(map(repr, row)) for row in rows.tolist()]
    (folder / SPHERIC).write_text("\n".join([HEADER, *lines]) + "\n \n")
