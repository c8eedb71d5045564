"""Recordings of cloths by motion capture: Coltraro et al., IJRR 2025.

Zenodo record 14644526, whose licence is named in two ways (CC BY-SA, CC BY-NC-SA): keep to the
stricter one. A CSV each, with the columns Frame, Time, X1, Y1, Z1, X2, ..., 120 frames a second.
"""

import csv
import dataclasses
import pathlib

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.tables import check_increasing, numbers, read_rows

FRAME_RATE = 120.0  # [1/s]
MARKERS = {"A2": 20, "A3": 12}  # On cloths of these sizes of paper.


@dataclasses.dataclass(frozen=True)
class Markers:
    """Where markers on a cloth were.

    Attributes:
        frames: (n,) their numbers, increasing.
        times: (n,) [s], increasing.
        positions: (n, markers, 3), in the unit of the file.
    """

    frames: np.ndarray
    times: np.ndarray
    positions: np.ndarray


def read_markers(path: pathlib.Path) -> Markers:
    """Reads a recording.

    Raises:
        StoreError: with the name of the file, if columns are others or in another order, numbers
            not finite, or frames or times do not increase.
    """
    names, rows = read_rows(path)
    expected = _columns(max((len(names) - 2) // 3, 1))
    if names != expected:
        raise StoreError(f"{path}: columns {names[:5]}..., expected {expected[:5]}...")
    values = numbers(path, rows)
    frames, times = values[:, 0].astype(np.int64), values[:, 1]
    check_increasing(path, frames)
    check_increasing(path, times)
    return Markers(frames, times, values[:, 2:].reshape(len(values), -1, 3))


def write_markers(path: pathlib.Path, markers: Markers) -> None:
    """Writes a recording as `read_markers` reads it, with all bits of its numbers.

    Raises:
        InvalidArgumentError: if shapes do not belong together.
    """
    shape = markers.positions.shape
    if len(shape) != 3 or shape[2] != 3 or not shape[0] == len(markers.times) > 0:
        raise InvalidArgumentError("positions", shape, f"a shape ({len(markers.times)}, n, 3)")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_columns(shape[1]))
        flat = markers.positions.reshape(shape[0], -1)
        for frame, time, row in zip(markers.frames, markers.times, flat, strict=True):
            writer.writerow([int(frame), repr(float(time)), *map(repr, row.tolist())])


def _columns(number: int) -> list[str]:
    return ["Frame", "Time", *(f"{axis}{i}" for i in range(1, number + 1) for axis in "XYZ")]
