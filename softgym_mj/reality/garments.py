"""Recordings of garments in the hands of two arms: RGBench, AAAI 2026.

Hugging Face, `RGBench/RGBench-Cloth-Sim2Real-v1`, CC-BY 4.0; nothing is downloaded here. A capture
is a folder `<garment>/<garment>_<action>_<stamp>` with a transform, joints of both arms and clouds.

The documentation describes joints by stamps and lists, the code writes and reads them in
columns of their own, with the pose of the end effector: both are read here.

A cloud's name says when it was taken; in the simulation that is this time minus the first stamp of
the joints plus the delay of the camera. No known slip of the data is repaired here.
"""

import ast
import csv
import dataclasses
import json
import math
import pathlib
import re

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_name
from softgym_mj.reality.clouds import read_pcd, write_pcd
from softgym_mj.reality.tables import check_increasing, numbers, read_rows

GARMENTS = (
    "beige_hoodie",
    "blue_dress",
    "brown_coat",
    "green_tshirt",
    "grey_pleat_skirt",
    "grey_sunwear",
    "khaki_blazer",
    "white_cakeskirt",
    "white_shirt",
)
ACTIONS = ("fling", "fold", "grasp")
ARMS = ("left", "right")
STAMP = ("header.stamp.secs", "header.stamp.nsecs")
JOINTS = ("name", "position")
WIDE, END = "time", ("pos_x", "pos_y", "pos_z")  # Columns of the other layout.
# Folders that are called otherwise than their garment.
OTHER_NAMES = {
    "blazer": "khaki_blazer",
    "sunwear": "grey_sunwear",
    "white_dress": "white_cakeskirt",
}
TRANSFORM = "calibration/world_to_camera_transform.json"
_CLOUD = re.compile(r"pointcloud_(\d+(?:\.\d+)?)_segmented\.pcd")
_RIGID = 1e-4  # By how much a rotation may be none; files have some six digits.


@dataclasses.dataclass(frozen=True)
class JointStates:
    """What an arm's joints did.

    Attributes:
        names: of the joints.
        times: (n,) [s], increasing.
        positions: (n, joints) [rad], of the gripper [m].
        ends: (n, 3) [m] where the end effector was, in the frame of the arm's base; None if the
            file does not say.
    """

    names: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    ends: np.ndarray | None = None


@dataclasses.dataclass(frozen=True)
class Capture:
    """One recording.

    Attributes:
        garment, action: of `GARMENTS` and `ACTIONS`.
        camera: (4, 4) from the world's frame to the camera's; lengths in metres.
        arms: joints of the left and the right arm.
        times: (n,) [s] of the clouds, increasing, by the clock of the joints' stamps.
        clouds: (k, 3) [m] each, in the camera's frame.
    """

    garment: str
    action: str
    camera: np.ndarray
    arms: dict[str, JointStates]
    times: np.ndarray
    clouds: list[np.ndarray]

    def world_clouds(self) -> list[np.ndarray]:
        """The clouds (k, 3) [m] in the world's frame, in double precision."""
        turn, place = self.camera[:3, :3], self.camera[:3, 3]
        return [np.linalg.solve(turn, (cloud - place).T).T for cloud in self.clouds]

    @property
    def first_stamp(self) -> float:
        """When the joints' recording starts [s]."""
        return min(float(arm.times[0]) for arm in self.arms.values())

    def simulated_times(self, delay: float) -> np.ndarray:
        """When the clouds were taken (n,) [s] after the start of the joints' recording.

        Args:
            delay: of the camera [s], about one frame.
        """
        return self.times - self.first_stamp + delay


def read_capture(folder: pathlib.Path) -> Capture:
    """Reads a folder `<garment>_<action>_<stamp>`.

    Raises:
        StoreError: with the name of the file, if it is of an unknown garment or action, or if
            anything in it is missing or damaged.
    """
    garment, action = case(folder)
    camera = _transform(folder / TRANSFORM)
    arms = {arm: _joints(_joints_file(folder, arm)) for arm in ARMS}
    stamps = {}
    for path in (folder / "segment_pcds").glob("*.pcd"):
        match = _CLOUD.fullmatch(path.name)
        if match is None:
            raise StoreError(f"{path}: expected pointcloud_<time>_segmented.pcd")
        stamps[path] = float(match[1])
    if not stamps:
        raise StoreError(f"{folder / 'segment_pcds'}: has no clouds")
    paths = sorted(stamps, key=stamps.__getitem__)
    times = np.array([stamps[path] for path in paths])
    check_increasing(folder / "segment_pcds", times)
    return Capture(garment, action, camera, arms, times, [read_pcd(p).points for p in paths])


def write_capture(folder: pathlib.Path, capture: Capture) -> None:
    """Writes a capture as `read_capture` reads it.

    Of arms with ends it writes columns, with all bits; of others stamps to the nanosecond and
    lists.

    Raises:
        InvalidArgumentError: if the folder's name is of another case.
    """
    check_name("garment", capture.garment, GARMENTS)
    check_name("action", capture.action, ACTIONS)
    try:
        named = case(folder)
    except StoreError:
        named = None
    if named != (capture.garment, capture.action):
        valid = f"{capture.garment}_{capture.action}_<stamp>"
        raise InvalidArgumentError("folder", folder.name, valid)
    for part in ("calibration", "joints", "segment_pcds"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    (folder / TRANSFORM).write_text(json.dumps(capture.camera.tolist()))
    for arm in ARMS:
        states = capture.arms[arm]
        with _joints_file(folder, arm).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            if states.ends is not None:
                writer.writerow([WIDE, *(f"pos_{name}" for name in states.names), *END])
                rows = np.column_stack([states.times, states.positions, states.ends])
                writer.writerows([map(repr, row) for row in rows.tolist()])
                continue
            writer.writerow([*STAMP, *JOINTS])
            for time, row in zip(states.times, states.positions, strict=True):
                seconds = math.floor(time)  # Apart: nanoseconds of an epoch are no double.
                rest = round((float(time) - seconds) * 1e9)
                writer.writerow([seconds, rest, list(states.names), row.tolist()])
    for time, cloud in zip(capture.times, capture.clouds, strict=True):
        write_pcd(folder / "segment_pcds" / f"pointcloud_{float(time)!r}_segmented.pcd", cloud)


def case(folder: pathlib.Path) -> tuple[str, str]:
    """Garment and action of the folder of a capture, by its name.

    Raises:
        StoreError: for an unknown garment or action.
    """
    for name, garment in (OTHER_NAMES | {garment: garment for garment in GARMENTS}).items():
        for action in ACTIONS:
            if folder.name.startswith(f"{name}_{action}_"):
                return garment, action
    raise StoreError(
        f"{folder}: unknown garment or action; garments: {', '.join(GARMENTS)}; "
        f"actions: {', '.join(ACTIONS)}"
    )


def _transform(path: pathlib.Path) -> np.ndarray:
    try:
        matrix = np.array(json.loads(path.read_text()), dtype=float)
    except (OSError, ValueError, TypeError) as error:
        raise StoreError(f"{path}: missing, or no matrix ({error})") from error
    if matrix.shape != (4, 4):
        raise StoreError(f"{path}: a transform of the shape {matrix.shape}, not (4, 4)")
    turn = matrix[:3, :3]
    rigid = np.abs(turn @ turn.T - np.eye(3)).max() < _RIGID
    if not (np.isfinite(matrix).all() and rigid and (matrix[3] == [0, 0, 0, 1]).all()):
        raise StoreError(f"{path}: no rigid transform")
    return matrix


def _joints_file(folder: pathlib.Path, arm: str) -> pathlib.Path:
    return folder / "joints" / f"{arm}_arm_joint_states_and_end_pose.csv"


def _joints(path: pathlib.Path) -> JointStates:
    """Columns are found by their names: there are others, and their order is not published."""
    columns, rows = read_rows(path)
    if WIDE in columns:
        return _wide(path, columns, rows)
    missing = [name for name in (*STAMP, *JOINTS) if name not in columns]
    if missing:
        raise StoreError(f"{path}: lacks the columns {', '.join(missing)}; it has {columns}")
    seconds, nanoseconds, named, placed = (columns.index(name) for name in (*STAMP, *JOINTS))
    stamps = numbers(path, [[row[seconds], row[nanoseconds]] for row in rows])
    times = stamps[:, 0] + stamps[:, 1] * 1e-9
    check_increasing(path, times)
    try:
        names = [tuple(ast.literal_eval(row[named])) for row in rows]
        positions = [list(ast.literal_eval(row[placed])) for row in rows]
    except (ValueError, SyntaxError, TypeError) as error:
        raise StoreError(f"{path}: names or positions are no lists ({error})") from error
    for number, (name, place) in enumerate(zip(names, positions, strict=True), start=2):
        if name != names[0] or len(place) != len(name):
            raise StoreError(f"{path}: line {number} has other joints than the first")
    return JointStates(names[0], times, numbers(path, positions))


def _wide(path: pathlib.Path, columns: list[str], rows: list[list[str]]) -> JointStates:
    """Joints in columns of their own: time, pos_1, ..., pos_gripper, pos_x, pos_y, pos_z, ..."""
    missing = [name for name in END if name not in columns]
    joints = [name for name in columns if name.startswith("pos_") and name not in END]
    if missing or not joints:
        lacking = ", ".join([*missing, *([] if joints else ["pos_1"])])
        raise StoreError(f"{path}: lacks the columns {lacking}; it has {columns}")
    places = [columns.index(name) for name in (WIDE, *joints, *END)]
    values = numbers(path, [[row[place] for place in places] for row in rows])
    check_increasing(path, values[:, 0])
    names = tuple(name.removeprefix("pos_") for name in joints)
    return JointStates(names, values[:, 0], values[:, 1 : 1 + len(names)], values[:, -3:])
