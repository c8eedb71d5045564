"""Motions of pickers, for reactive experts."""

from collections.abc import Sequence
from typing import NamedTuple

from softgym_mj.metrics import Array, namespace
from softgym_mj.robots.gripper import MAX_DISPLACEMENT

STRIDE = 8 * MAX_DISPLACEMENT  # [m] Displacement in an env step of 8 sim steps at full speed.


class Motion(NamedTuple):
    """Goal of one picker.

    Attributes:
        goal: (..., 3) [m].
        closed: whether it is closed (...).
        speed: fraction of full speed (...).
    """

    goal: Array
    closed: Array
    speed: Array


def actions(centers: Array, motions: Sequence[Motion]) -> Array:
    """Returns actions (..., 4 k) of k pickers that move straight to their goals.

    Args:
        centers: (..., k, 3) [m].
        motions: one of each picker.
    """
    xp, parts = namespace(centers), []
    for i, (goal, closed, speed) in enumerate(motions):
        move = (goal - centers[..., i, :]) / STRIDE
        move = move * (speed / xp.maximum(xp.max(xp.abs(move), axis=-1), speed))[..., None]
        parts += [move, xp.where(closed, xp.ones_like(speed), -xp.ones_like(speed))[..., None]]
    return xp.concat(parts, axis=-1)


def at(across: Array, height: Array) -> Array:
    """Returns points (..., 3) [m] of horizontal positions (..., 2) and heights (...) [m]."""
    return namespace(across).concat([across, height[..., None]], axis=-1)
