"""Symmetries of tasks as data: the same task, seen from another side of the world.

A task declares them in one line, `symmetries = anywhere("same", "reversed")`; those that exchange
pickers are added for it. `learning.symmetries` makes matrices of them.
"""

import itertools
from typing import NamedTuple

import numpy as np

from softgym_mj.exceptions import check_name

# Orders in which an object's points can be listed: a rope's from its other end, a cloth's with
# rows, columns or both reversed.
ORDERS = ("same", "reversed", "rows", "columns", "both")


class Turned(NamedTuple):
    """A way to see a task that leaves its rewards and dynamics as they are.

    Attributes:
        turn: (3, 3) by which positions in the world are multiplied.
        order: of the object's points, one of `ORDERS`.
    """

    turn: np.ndarray
    order: str = "same"


_SAME, _MIRROR = np.eye(3), np.diag([1.0, -1.0, 1.0])  # The latter across the XZ plane.


def anywhere(*orders: str) -> tuple[Turned, ...]:
    """Right angles about Z and their mirror images, with each of some orders of points.

    Of a task whose goal has no place of its own in the world.

    Raises:
        InvalidArgumentError: for an order that is none of `ORDERS`.
    """
    for order in orders:
        check_name("order", order, ORDERS)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = [np.linalg.matrix_power(quarter, k) for k in range(4)]
    turns += [turn @ _MIRROR for turn in turns]
    return tuple(Turned(turn, order) for turn, order in itertools.product(turns, orders))


def mirrored(order: str = "same") -> tuple[Turned, ...]:
    """The mirror image across the XZ plane, with an order of points, beside the task as it is.

    Of a task whose goal lies in that plane.

    Raises:
        InvalidArgumentError: for an order that is none of `ORDERS`.
    """
    check_name("order", order, ORDERS)
    return Turned(_SAME), Turned(_MIRROR, order)
