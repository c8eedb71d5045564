"""Rotations as rotation vectors [rad] and as quaternions (w, x, y, z), of n things at once.

MuJoCo's functions are used because their bits do not depend on the processor.
"""

import math
from collections.abc import Sequence

import mujoco
import numpy as np


def quaternions(vectors: np.ndarray) -> np.ndarray:
    """Returns unit quaternions (n, 4) of rotation vectors (n, 3) [rad]."""
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(vectors), 1))
    for quaternion, vector in zip(turned, vectors, strict=True):
        mujoco.mju_quatIntegrate(quaternion, vector, 1.0)
    return turned


def vectors(turns: np.ndarray) -> np.ndarray:
    """Returns rotation vectors (n, 3) [rad], at most pi long, of unit quaternions (n, 4)."""
    found = np.empty((len(turns), 3))
    for vector, quaternion in zip(found, turns, strict=True):
        mujoco.mju_quat2Vel(vector, quaternion, 1.0)
    return found


def compose(second: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Returns the rotations (n, 4) by `first` (n, 4), then by `second` (n, 4)."""
    both = np.empty_like(first)
    for turn, a, b in zip(both, second, first, strict=True):
        mujoco.mju_mulQuat(turn, a, b)
        mujoco.mju_normalize4(turn)  # Avoids drift over thousands of compositions.
    return both


def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns rotation vectors (n, 3) [rad] in world axes from rotations (n, 4) to others."""
    return vectors(compose(end, start * [1.0, -1.0, -1.0, -1.0]))


def from_matrices(matrices: np.ndarray) -> np.ndarray:
    """Returns unit quaternions (n, 4) of rotation matrices (n, 3, 3)."""
    turns = np.empty((len(matrices), 4))
    for turn, matrix in zip(turns, matrices, strict=True):
        mujoco.mju_mat2Quat(turn, matrix.ravel())
    return turns


def at_mounts(upright: np.ndarray, yaws: Sequence[float]) -> np.ndarray:
    """Returns quaternions (n, 4) of tools on mounts that are turned by `yaws` [rad] about Z.

    Args:
        upright: orientation of a tool in the frame of its mount (3, 3).
        yaws: directions that the mounts face [rad].
    """
    own = signed(upright)
    facing = np.array([[math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)] for yaw in yaws])
    return compose(facing, np.tile(own, (len(facing), 1)))


def signed(matrix: np.ndarray) -> np.ndarray:
    """Returns the unit quaternion (4,) of a rotation matrix (3, 3) whose first entry is positive.

    Entries below 0.1 do not count: rounding may change their sign.
    """
    (turn,) = from_matrices(matrix[None])
    return turn * np.sign(turn[np.argmax(np.abs(turn) > 0.1)])


def nearest(turns: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Returns unit quaternions (n, 4) with the signs that are nearer to others (n, 4)."""
    return turns * np.where((turns * others).sum(-1, keepdims=True) < 0.0, -1.0, 1.0)


def matrices(turns: np.ndarray) -> np.ndarray:
    """Returns rotation matrices (n, 3, 3) of unit quaternions (n, 4)."""
    found = np.empty((len(turns), 9))
    for matrix, turn in zip(found, turns, strict=True):
        mujoco.mju_quat2Mat(matrix, turn)
    return found.reshape(-1, 3, 3)


def upright(turns: np.ndarray, most: float) -> np.ndarray:
    """Returns orientations (n, 4) of tools, tilted back to at most `most` [rad].

    The tilt is the angle from straight down to the tool's z axis.
    """
    axes = matrices(turns)[:, :, 2]
    back = np.zeros_like(axes)
    for vector, (x, y, z) in zip(back, axes, strict=True):
        across = np.array([-y, x, 0.0])  # The axis's cross product with straight down.
        sine = mujoco.mju_normalize3(across)
        vector[:] = max(float(np.arctan2(sine, -z)) - most, 0.0) * across
    return compose(quaternions(back), turns)
