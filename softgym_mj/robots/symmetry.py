"""`ActorSymmetry`: how the numbers of an actor change when the world is turned or reflected."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag


class ActorSymmetry(NamedTuple):
    """Transformation of an actor that goes with one of the world.

    Attributes:
        order: For each gripper, which one it was before.
        sensed: Matrix (n, n) of the proprioception.
        remembered: Matrix (k, k) of what the actor remembers.
        action: Matrix (m, m) of actions.
    """

    order: tuple[int, ...]
    sensed: np.ndarray
    remembered: np.ndarray
    action: np.ndarray


def blocks(parts: Sequence[np.ndarray], order: Sequence[int]) -> np.ndarray:
    """Returns a matrix (n k, n k) with block i (k, k) at row i and column order[i]."""
    size = len(parts[0])
    result = np.zeros((len(parts) * size,) * 2)
    for i, (part, k) in enumerate(zip(parts, order, strict=True)):
        result[i * size : (i + 1) * size, k * size : (k + 1) * size] = part
    return result


def gripper_symmetry(turn: np.ndarray, order: Sequence[int]) -> ActorSymmetry:
    """Returns the transformation of grippers that sense their positions and move along axes.

    Args:
        turn: Matrix (3, 3) that transforms positions in the world.
        order: For each gripper, which one it was before.
    """
    number = len(order)
    # For each gripper: whether it holds a vertex, and its offset to that vertex.
    remembered = blocks([block_diag(1.0, turn)] * number, order)
    action = blocks([block_diag(turn, 1.0)] * number, order)
    return ActorSymmetry(tuple(order), blocks([turn] * number, order), remembered, action)
