"""Recordings of dam breaks and sloshing, read from files of others; nothing is downloaded here.

Tables in Python files are read as text of string literals: nothing of such a file is executed.
"""

import ast
import dataclasses
import pathlib

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.storage.files import read_whole

DAM_BREAKS, SLOSHING = "db_exp_data.py", "st_exp_data.py"
SPHERIC = "test_case_2_exp_data.dat"
SOURCES = {
    DAM_BREAKS: "pysph/examples of PyPI's PySPH 1.0b2 (BSD-3)",
    SLOSHING: "pysph/examples of PyPI's PySPH 1.0b2 (BSD-3)",
    SPHERIC: "github.com/sanguinariojoe/aquagpusph, commit 8f61634, "
    "examples/3D/spheric_testcase2_dambreak/src/templates (GPL-3)",
}
GUIDE = "a folder with {} from {}; this command downloads nothing"
FEWEST = 4  # Rows of a table.
MOST_BYTES = 20_000_000
SPHERIC_COLUMNS = 13  # Time, eight pressures, four heights.


@dataclasses.dataclass(frozen=True)
class Series:
    """A recorded quantity.

    Attributes:
        times: (n,) in the unit of the recording, ascending.
        values: (n,) in the unit of the recording.
    """

    times: np.ndarray
    values: np.ndarray


def read_table(folder: pathlib.Path | None, file: str, name: str) -> Series:
    """Reads a table of two columns that a Python file assigns to a name as a string.

    Args:
        folder: Folder of the file.
        file: `DAM_BREAKS` or `SLOSHING`.
        name: Variable that the table is assigned to.

    Raises:
        InvalidArgumentError: If the folder has no such file.
        StoreError: If the file has no such table.
    """
    path = _find(folder, file)
    try:
        body = ast.parse(_read(path)).body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise StoreError(f"{path} is not a Python file: {error}") from error
    for statement in body:
        if not isinstance(statement, ast.Assign) or not isinstance(statement.value, ast.Constant):
            continue
        names = [target.id for target in statement.targets if isinstance(target, ast.Name)]
        if name in names and isinstance(statement.value.value, str):
            lines = [line for line in statement.value.value.splitlines() if line.strip()]
            return _series(f"{path}, {name}", _numbers(f"{path}, {name}", lines, 2), 1)
    raise StoreError(f"{path} assigns no string to {name}")


def read_heights(folder: pathlib.Path | None) -> list[Series]:
    """Reads the water heights [m] of the four gauges of SPHERIC's second test case, over time [s].

    Raises:
        InvalidArgumentError: If the folder has no such file.
        StoreError: If the file has another layout.
    """
    path = _find(folder, SPHERIC)
    lines = [line for line in _read(path).splitlines() if line.strip()]
    if not lines or "H4" not in lines[0]:
        raise StoreError(f"{path} does not begin with a line of titles that ends with H4")
    table = _numbers(str(path), lines[1:], SPHERIC_COLUMNS)
    return [_series(str(path), table, k) for k in range(SPHERIC_COLUMNS - 4, SPHERIC_COLUMNS)]


def _find(folder: pathlib.Path | None, file: str) -> pathlib.Path:
    if folder is None or not (folder / file).is_file():
        valid = GUIDE.format(file, SOURCES[file])
        raise InvalidArgumentError("folder", None if folder is None else str(folder), valid)
    return folder / file


def _read(path: pathlib.Path) -> str:
    content = read_whole(path)
    if len(content) > MOST_BYTES:
        raise StoreError(f"{path} has {len(content)} bytes, expected at most {MOST_BYTES}")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise StoreError(f"{path} is not text: {error}") from error


def _numbers(where: str, lines: list[str], columns: int) -> np.ndarray:
    try:
        table = np.array([[float(word) for word in line.split()] for line in lines])
    except ValueError as error:
        raise StoreError(f"{where} is not a table of numbers: {error}") from error
    if table.ndim != 2 or table.shape[0] < FEWEST or table.shape[1] != columns:
        raise StoreError(f"{where}: shape {table.shape}, not (rows >= {FEWEST}, {columns})")
    if not np.isfinite(table).all():
        raise StoreError(f"{where}: numbers are not finite")
    return table


def _series(where: str, table: np.ndarray, column: int) -> Series:
    order = np.argsort(table[:, 0], kind="stable")  # Some digitized points are out of order.
    times = table[order, 0]
    if times[-1] <= times[0]:
        raise StoreError(f"{where}: times do not ascend")
    return Series(times, table[order, column])
