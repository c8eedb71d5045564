"""Symmetries of tasks as data: transformations of the world that leave the task unchanged.

A task declares them in one line, `symmetries = anywhere("same", "reversed")`; exchanges of pickers
are added automatically. `learning.symmetries` converts them to matrices.
"""

import itertools
from typing import NamedTuple

import numpy as np

from softgym_mj.exceptions import check_name

# Orders of an object's points: a rope from its other end, a cloth with rows, columns or both
# reversed.
ORDERS = ("same", "reversed", "rows", "columns", "both")


class Turned(NamedTuple):
    """Transformation that leaves a task's rewards and dynamics unchanged.

    Attributes:
        turn: (3, 3) matrix that transforms positions in the world.
        order: order of the object's points, one of `ORDERS`.
    """

    turn: np.ndarray
    order: str = "same"


_SAME, _MIRROR = np.eye(3), np.diag([1.0, -1.0, 1.0])  # The latter reflects across the XZ plane.
_QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_ROTATIONS = [np.linalg.matrix_power(_QUARTER, k) for k in range(4)]
_REFLECTIONS = [turn @ _MIRROR for turn in _ROTATIONS]


def anywhere(*orders: str) -> tuple[Turned, ...]:
    """Returns rotations by right angles about Z and their reflections, with orders of points.

    They suit a task whose goal has no fixed place in the world.

    Raises:
        InvalidArgumentError: for an order that is none of `ORDERS`.
    """
    for order in orders:
        check_name("order", order, ORDERS)
    turns = [*_ROTATIONS, *_REFLECTIONS]
    return tuple(Turned(turn, order) for turn, order in itertools.product(turns, orders))


def two_sided() -> tuple[Turned, ...]:
    """Returns rotations by right angles about Z, and their reflections with points reversed.

    They suit an object whose points are mirror images in reversed order, such as the key points of
    a shirt, with a goal that has no fixed place in the world.
    """
    return (
        *(Turned(turn) for turn in _ROTATIONS),
        *(Turned(turn, "reversed") for turn in _REFLECTIONS),
    )


def mirrored(order: str = "same") -> tuple[Turned, ...]:
    """Returns the identity and the reflection across the XZ plane, with an order of points.

    They suit a task whose goal lies in that plane.

    Raises:
        InvalidArgumentError: for an order that is none of `ORDERS`.
    """
    check_name("order", order, ORDERS)
    return Turned(_SAME), Turned(_MIRROR, order)
