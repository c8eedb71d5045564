"""Numbers of CSV files, whose columns have to be the ones that are expected."""

import csv
import pathlib
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import StoreError


def read_rows(path: pathlib.Path) -> tuple[list[str], list[list[str]]]:
    """The names of columns and the rows, all as long as these.

    Raises:
        StoreError: if the file is missing, or a row has another number of columns.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise StoreError(f"{path}: missing or unreadable ({error})") from error
    if len(lines) < 2:
        raise StoreError(f"{path}: has no rows")
    names = [name.strip() for name in lines[0]]
    for number, row in enumerate(lines[1:], start=2):
        if len(row) != len(names):
            raise StoreError(f"{path}: line {number} has {len(row)} columns, not {len(names)}")
    return names, lines[1:]


def numbers(path: pathlib.Path, rows: Sequence[Sequence[str]]) -> np.ndarray:
    """Words as finite numbers (n, k).

    Raises:
        StoreError: if one is none.
    """
    try:
        values = np.array(rows, dtype=float)
    except ValueError as error:
        raise StoreError(f"{path}: {error}") from error
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        row, column = wrong[0]
        raise StoreError(f"{path}: row {row}, column {column} of its numbers is not finite")
    return values


def check_increasing(path: pathlib.Path, stamps: np.ndarray) -> None:
    """Raises `StoreError` unless each of the stamps (n,) is later than the one before."""
    wrong = np.flatnonzero(np.diff(stamps) <= 0.0)
    if len(wrong):
        i = int(wrong[0])
        pair = f"{float(stamps[i])!r}, {float(stamps[i + 1])!r}"
        raise StoreError(f"{path}: unsorted stamps at row {i + 1}: {pair}")
