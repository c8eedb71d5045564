"""Recordings of a cloth on a robot's tool: Luque Acera, master's thesis, ETSEIB 2021.

Their files are those of the folder `FOLDER` of `SOURCE`: `<name>_mesh.csv` has the nodes in the
frame of a depth camera [m], `<name>_tcp.csv` the pose of the tool in the robot's frame, and
`n<size>_calibration_campose.csv` that of the camera; stamps are in nanoseconds. Nothing is
downloaded here.
"""

import csv
import dataclasses
import io
import math
import pathlib
import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from softgym_mj.exceptions import StoreError
from softgym_mj.reality.folders import no_recordings
from softgym_mj.storage.files import read_whole

SOURCE = "github.com/Alados5/tfm_matlab, commit ea4056c"
FOLDER = "learn_model/Gathered Data/Session_2021_07_05/Converted CSV"
GUIDE = (
    f"the folder `{FOLDER}` of {SOURCE}, with range30_rep1_mesh.csv and so on; this command "
    "downloads nothing, and that repository has no license file"
)
FEWEST_NODES = 4  # Nodes along a side.
_FEWEST_ROWS = 2
_NANOSECOND = 1e-9  # [s]
_DISTINCT = 1e-4  # [s] Tool poses closer in time are repetitions.
_UNIT = 0.01  # Largest deviation of a quaternion's length from 1.
_STAMP = "field.header.stamp"
_AXES = "xyz"


@dataclasses.dataclass(frozen=True)
class Recording:
    """Recorded motion of a cloth; the robot's base is the frame, Z up.

    Attributes:
        name: Name of the recording.
        tool_times: (m,) [s] in order; 0 is the first pose of the tool.
        tool_positions: (m, 3) [m] of the tool.
        tool_rotations: (m, 4) unit quaternions (x, y, z, w) of the tool.
        stamps: (f,) [s] at which frames of the camera were published.
        nodes: (f, n, n, 3) [m] nodes in each frame, NaN if missing: first index along the held
            edge, second index down from it, 0 on the edge.
    """

    name: str
    tool_times: np.ndarray
    tool_positions: np.ndarray
    tool_rotations: np.ndarray
    stamps: np.ndarray
    nodes: np.ndarray

    def tool(self, times: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Returns positions (k, 3) [m] and rotations of the tool at times (k,) [s].

        Poses are interpolated; before the first and after the last the tool is at rest.
        """
        times = np.clip(times, self.tool_times[0], self.tool_times[-1])
        at = [np.interp(times, self.tool_times, axis) for axis in self.tool_positions.T]
        turns = Slerp(self.tool_times, Rotation.from_quat(self.tool_rotations))
        return np.stack(at, axis=1), turns(times)


def read_recordings(folder: pathlib.Path | None) -> list[Recording]:
    """Reads the recordings of a session, in the order of the numbers in their names.

    Raises:
        InvalidArgumentError: For a folder without recordings.
        StoreError: For a file of another layout; its message names file, row and field.
    """
    files = [] if folder is None else sorted(folder.glob("*_mesh.csv"), key=_order)
    names = [file.name.removesuffix("_mesh.csv") for file in files]
    names = [name for name in names if "calibration" not in name]
    if folder is None or not names:
        raise no_recordings(folder, GUIDE)
    return [read_recording(folder, name) for name in names]


def read_recording(folder: pathlib.Path, name: str) -> Recording:
    """Reads a recording by name.

    Raises:
        StoreError: For a file that is missing or of another layout; its message names file, row
            and field.
    """
    mesh = _Table(folder / f"{name}_mesh.csv")
    size = mesh.size()
    fields = [f"field.{axis}{i}" for axis in _AXES for i in range(size**2)]
    nodes = mesh.numbers(fields, missing=True).reshape(-1, 3, size, size)
    position, rotation = _camera(folder / f"n{size}_calibration_campose.csv")
    nodes = rotation.apply(nodes.transpose(0, 2, 3, 1).reshape(-1, 3)) + position
    nodes[np.isnan(nodes).any(axis=1)] = np.nan
    tool = _Table(folder / f"{name}_tcp.csv")
    stamps, poses = tool.stamps(), tool.poses("field.pose.")
    kept = np.diff(stamps, prepend=-math.inf) > _DISTINCT
    if kept.sum() < _FEWEST_ROWS:
        raise StoreError(f"{tool.file} has fewer than {_FEWEST_ROWS} poses at distinct times")
    stamps, poses, begin = stamps[kept], poses[kept], stamps[0]
    return Recording(
        name,
        stamps - begin,
        poses[:, :3],
        poses[:, 3:],
        mesh.stamps() - begin,
        nodes.reshape(-1, size, size, 3),
    )


def _order(file: pathlib.Path) -> list[tuple[int, str]]:
    """Returns a key that orders numbers in names by value."""
    parts = re.split(r"(\d+)", file.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _camera(file: pathlib.Path) -> tuple[np.ndarray, Rotation]:
    """Returns the mean pose (3,) [m] and rotation of the camera in the robot's frame."""
    poses = _Table(file, fewest=1).poses("field.")
    return poses[:, :3].mean(axis=0), Rotation.from_quat(poses[:, 3:]).mean()


class _Table:
    """Rows of a CSV file by the names of its fields."""

    def __init__(self, file: pathlib.Path, fewest: int = _FEWEST_ROWS):
        self.file = file
        content = read_whole(file).decode("utf-8", errors="replace")
        try:
            header, *self._rows = list(csv.reader(io.StringIO(content), strict=True)) or [[]]
        except csv.Error as error:
            raise StoreError(f"{file} is not a CSV file: {error}") from error
        self._at = {name: i for i, name in enumerate(header)}
        for number, row in enumerate(self._rows, start=2):
            if len(row) != len(header):
                raise StoreError(f"{file}, row {number}: {len(row)} fields, expected {len(header)}")
        if len(self._rows) < fewest:
            raise StoreError(f"{file} has {len(self._rows)} rows, expected {fewest} or more")

    def numbers(self, fields: Sequence[str], missing: bool = False) -> np.ndarray:
        """Returns values (rows, fields), finite, or NaN if they may be missing."""
        values = np.empty((len(self._rows), len(fields)))
        for j, field in enumerate(fields):
            if field not in self._at:
                raise StoreError(f"{self.file}, row 1: the field {field!r} is missing")
            for i, row in enumerate(self._rows):
                text = row[self._at[field]]
                values[i, j] = self._number(text, i, field, missing)
        return values

    def _number(self, text: str, row: int, field: str, missing: bool) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.inf
        if math.isfinite(value) or (missing and math.isnan(value)):
            return value
        valid = "a finite number" + (" or nan" if missing else "")
        raise StoreError(f"{self.file}, row {row + 2}, field {field!r}: {text!r} is not {valid}")

    def stamps(self) -> np.ndarray:
        """Returns stamps (rows,) [s], in order."""
        stamps = self.numbers([_STAMP])[:, 0] * _NANOSECOND
        back = np.flatnonzero(np.diff(stamps) < 0.0)
        if len(back):
            place = f"{self.file}, row {back[0] + 3}, field {_STAMP!r}"
            raise StoreError(f"{place}: it is earlier than the row before; rows must be in order")
        return stamps

    def size(self) -> int:
        """Returns the number of nodes along a side, the same in all rows."""
        sizes = self.numbers(["field.size"])[:, 0]
        wrong = np.flatnonzero((sizes != sizes[0]) | (sizes % 1 != 0) | (sizes < FEWEST_NODES))
        if len(wrong):
            place = f"{self.file}, row {wrong[0] + 2}, field 'field.size'"
            valid = f"a whole number from {FEWEST_NODES} on, the same in all rows"
            raise StoreError(f"{place}: {sizes[wrong[0]]:g} is not {valid}")
        return int(sizes[0])

    def poses(self, prefix: str) -> np.ndarray:
        """Returns positions [m] and quaternions (x, y, z, w) of length 1: (rows, 7)."""
        fields = [f"{prefix}position.{axis}" for axis in _AXES]
        fields += [f"{prefix}orientation.{axis}" for axis in "xyzw"]
        poses = self.numbers(fields)
        lengths = np.linalg.norm(poses[:, 3:], axis=1)
        wrong = np.flatnonzero(np.abs(lengths - 1.0) > _UNIT)
        if len(wrong):
            place = f"{self.file}, row {wrong[0] + 2}, fields '{prefix}orientation.x' to '.w'"
            raise StoreError(f"{place}: a quaternion of length {lengths[wrong[0]]:.3g}, expected 1")
        return poses
