"""Rotations as rotation vectors [rad] and as quaternions (w, x, y, z), of n things at once.

MuJoCo's functions are used because their bits do not depend on the processor.
"""

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
