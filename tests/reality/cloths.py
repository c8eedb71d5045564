"""Writes recordings of a cloth on a tool in the layout of the published ones."""

import csv
import pathlib

import numpy as np
from scipy.spatial.transform import Rotation

from softgym_mj.reality.cloth.recordings import Recording
from softgym_mj.reality.cloth.scenario import DELAY, Grip

NODES, SIDE = 4, 0.29  # Along a side; [m].
GRIP = Grip(
    np.stack([np.zeros(NODES), np.linspace(-SIDE / 2, SIDE / 2, NODES), np.full(NODES, 0.09)], 1),
    np.array([SIDE, SIDE]),
    0.0,
)
CAMERA = np.array([0.02, -1.5, 0.1]), Rotation.from_euler("xyz", [-95.0, 4.0, 2.0], degrees=True)
RESTS = 0.6  # [s] Rest before the motion.
_BEGIN = 1_625_480_930.0  # [s]
# The tool's Z is down, its Y along the robot's X.
_DOWN = Rotation.from_matrix(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]))


def tool(width: float, times: np.ndarray, turn: float = 0.0) -> tuple[np.ndarray, Rotation]:
    """Returns poses of a tool that moves along Y and Z by a width [m] and turns [rad] about X."""
    phase = 2.0 * np.pi * 0.7 * np.maximum(times - RESTS, 0.0)
    at = np.stack([0.0 * phase, -0.4 + width * np.sin(phase), 0.34 + 0.05 * np.sin(2.0 * phase)], 1)
    return at, Rotation.from_euler("x", turn * np.sin(phase)[:, None]) * _DOWN


def recording(
    name: str, width: float, times: np.ndarray, nodes: np.ndarray, turn: float = 0.0
) -> Recording:
    """Returns a recording with nodes (f, n, n, 3) [m] at times (f,) [s], stamped late."""
    tool_times = np.arange(0.0, times[-1] + 0.5, 0.05)
    at, turns = tool(width, tool_times, turn)
    return Recording(name, tool_times, at, turns.as_quat(), times + DELAY, nodes)


def rigid(name: str, width: float, frames: int = 25, turn: float = 0.0) -> Recording:
    """Returns a recording of a flat sheet that hangs on the tool and moves with it."""
    empty = recording(name, width, 0.1 * np.arange(frames), np.zeros((frames, 1, 1, 3)), turn)
    at, turns = empty.tool(empty.stamps - DELAY)
    down = np.array([0.0, 0.0, 1.0]) * np.linspace(0.0, SIDE, NODES)[:, None]
    fixed = (GRIP.edge[:, None] + down).reshape(-1, 3)
    nodes = np.stack([t.apply(fixed) + p for p, t in zip(at, turns, strict=True)])
    return recording(name, width, empty.stamps - DELAY, nodes.reshape(-1, NODES, NODES, 3), turn)


def write(folder: pathlib.Path, own: Recording) -> None:
    """Writes the three files of a recording."""
    folder.mkdir(parents=True, exist_ok=True)
    place, turn = CAMERA
    seen = turn.inv().apply(own.nodes.reshape(-1, 3) - place).reshape(len(own.nodes), -1, 3)
    number = seen.shape[1]
    head = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    fields = [f"field.{axis}{i}" for axis in "xyz" for i in range(number)]
    side = own.nodes.shape[1]
    rows = [
        [0, i, _stamp(t), "camera", side, *map(repr, frame.T.ravel().tolist())]
        for i, (t, frame) in enumerate(zip(own.stamps, seen, strict=True))
    ]
    _write(folder / f"{own.name}_mesh.csv", [*head, "field.size", *fields], rows)
    pose = [f"position.{axis}" for axis in "xyz"] + [f"orientation.{axis}" for axis in "xyzw"]
    poses = np.concatenate([own.tool_positions, own.tool_rotations], axis=1)
    rows = [
        [0, i, _stamp(t), "base", *map(repr, p.tolist())]
        for i, (t, p) in enumerate(zip(own.tool_times, poses, strict=True))
    ]
    _write(folder / f"{own.name}_tcp.csv", [*head, *(f"field.pose.{p}" for p in pose)], rows)
    row = [0, *map(repr, [*place.tolist(), *turn.as_quat().tolist()])]
    file = folder / f"n{side}_calibration_campose.csv"
    _write(file, ["%time", *(f"field.{p}" for p in pose)], [row])


def _stamp(time: float) -> int:
    return round((_BEGIN + time) * 1e9)


def _write(file: pathlib.Path, header: list[str], rows: list[list[object]]) -> None:
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])
