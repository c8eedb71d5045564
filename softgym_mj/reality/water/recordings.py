"""Recordings of dam breaks and of sloshing: readers of files that others publish.

`db_exp_data.py` and `st_exp_data.py` of PySPH assign tables, as text, to names: they are parsed and
never run. `test_case_2_exp_data.dat` is SPHERIC's test case 2. Nothing is downloaded here.
"""

import ast
import dataclasses
import pathlib
from collections.abc import Mapping

import numpy as np

from softgym_mj.exceptions import StoreError
from softgym_mj.reality.folders import no_recordings
from softgym_mj.storage.files import read_whole

DAM_BREAKS, SLOSHING = "db_exp_data.py", "st_exp_data.py"
SPHERIC = "test_case_2_exp_data.dat"
SOURCES = {
    DAM_BREAKS: "PySPH 1.0b2, folder pysph/examples (BSD-3-Clause)",
    SLOSHING: "PySPH 1.0b2, folder pysph/examples (BSD-3-Clause)",
    SPHERIC: "github.com/sanguinariojoe/aquagpusph, commit 8f61634, examples/3D/"
    "spheric_testcase2_dambreak/src/templates (GPL-3.0 repository, data of SPHERIC)",
}
GUIDE = "a folder with {file}, of {source}; this command downloads nothing"
_HEADER = ["Time (s)", *(f"P{i} (Pa)" for i in range(1, 9)), *(f"H{i} (m)" for i in range(1, 5))]
_MOST = 2**24  # [bytes] Larger files are not parsed.


@dataclasses.dataclass(frozen=True)
class Series:
    """Recorded values over time, in the units of the experiment that they belong to.

    Attributes:
        times: (n,) in increasing order.
        values: (n,) or, of k gauges, (n, k).
    """

    times: np.ndarray
    values: np.ndarray


def read_table(folder: pathlib.Path | None, file: str, name: str) -> Series:
    """Reads the table of two columns, times and values, that a Python file assigns to a name.

    Args:
        folder: Folder of the file.
        file: `DAM_BREAKS` or `SLOSHING`.
        name: Name in the file.

    Raises:
        InvalidArgumentError: If the folder does not have the file.
        StoreError: If the file is no Python file, or assigns no such table of text to the name.
    """
    path = _found(folder, file)
    texts = _assigned_texts(path)
    if name not in texts:
        raise StoreError(f"{path} assigns no text to {name}")
    table = _numbers(path, name, texts[name].splitlines(), 2)
    # Figures were read off by hand: some points are in another order, or at one time.
    table = table[np.argsort(table[:, 0], kind="stable")]
    return Series(table[:, 0], table[:, 1])


def read_spheric(folder: pathlib.Path | None) -> Series:
    """Reads the water heights (n, 4) [m] at the gauges of SPHERIC's test case 2, and times [s].

    Raises:
        InvalidArgumentError: If the folder does not have the file.
        StoreError: If it has another layout.
    """
    path = _found(folder, SPHERIC)
    head, *lines = _text(path).splitlines() or [""]
    if head.split() != " ".join(_HEADER).split():
        raise StoreError(f"{path} is not a recording: its first line is not {' '.join(_HEADER)!r}")
    table = _numbers(path, "its table", lines, len(_HEADER))
    if (np.diff(table[:, 0]) <= 0.0).any():
        raise StoreError(f"{path} is not a recording: times do not increase")
    return Series(table[:, 0], table[:, -4:])


def _found(folder: pathlib.Path | None, file: str) -> pathlib.Path:
    path = None if folder is None else folder / file
    if path is None or not path.exists():
        raise no_recordings(folder, GUIDE.format(file=file, source=SOURCES[file]))
    return path


def _text(path: pathlib.Path) -> str:
    content = read_whole(path)
    if len(content) > _MOST:
        raise StoreError(f"{path} is not a recording: it is larger than {_MOST} bytes")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise StoreError(f"{path} is not a recording: {error}") from error


def _assigned_texts(path: pathlib.Path) -> Mapping[str, str]:
    """Returns the text literals that a Python file assigns to names; its code is not run."""
    try:
        body = ast.parse(_text(path)).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise StoreError(f"{path} is not a Python file: {error}") from error
    return {
        statement.targets[0].id: statement.value.value
        for statement in body
        if isinstance(statement, ast.Assign)
        and isinstance(statement.targets[0], ast.Name)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    }


def _numbers(path: pathlib.Path, name: str, lines: list[str], columns: int) -> np.ndarray:
    """Returns the numbers (n, columns) in lines, of which empty ones are skipped."""
    try:
        table = np.array([[float(word) for word in line.split()] for line in lines if line.strip()])
    except ValueError as error:
        raise StoreError(f"{path} is not a recording: {name}: {error}") from error
    if table.ndim != 2 or table.shape[1] != columns or len(table) < 2:
        shape = f"shape {table.shape}, not (2 or more, {columns})"
        raise StoreError(f"{path} is not a recording: {name} has {shape}")
    if not np.isfinite(table).all():
        raise StoreError(f"{path} is not a recording: {name} is not finite")
    return table
