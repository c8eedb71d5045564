"""Writes recordings of water in the layouts of the published files."""

import pathlib

import numpy as np

TITLES = "Time (s) " + " ".join(f"P{k} (Pa)" for k in range(1, 9))
TITLES += " " + " ".join(f"H{k} (m)" for k in range(1, 5))
DAM_BREAKS = ("mm_data_1", "mm_data_2", "ko_data", "ko_mps_data")


def table(rows: np.ndarray) -> str:
    """Returns rows as the text of a table."""
    return "\n".join("\t".join(map(repr, map(float, row))) for row in rows)


def write_tables(file: pathlib.Path, tables: dict[str, np.ndarray]) -> None:
    """Writes a Python file that would leave a mark beside it if it were executed."""
    mark = file.with_suffix(".ran")
    lines = ['"""Data."""', "import pathlib", f"pathlib.Path({str(mark)!r}).touch()"]
    lines += [f'{name} = u"""\n{table(rows)}\n"""' for name, rows in tables.items()]
    file.write_text("\n".join(lines), encoding="utf-8")


def write_heights(file: pathlib.Path, times: np.ndarray, heights: np.ndarray) -> None:
    """Writes heights (n, 4) [m] over times (n,) [s], with pressures of zero."""
    rows = np.hstack([times[:, None], np.zeros((len(times), 8)), heights])
    file.write_text(TITLES + "\n" + table(rows).replace("\t", " ") + "\n", encoding="utf-8")
