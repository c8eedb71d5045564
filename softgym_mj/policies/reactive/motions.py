"""Motions of pickers, for reactive experts."""

from collections.abc import Sequence
from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.robots.gripper import MAX_DISPLACEMENT

STRIDE = 8 * MAX_DISPLACEMENT  # [m] Displacement in an env step of 8 sim steps at full speed.
# A picker descends in a funnel, with a radius at the bottom [m] and a slope, and moves across less
# the deeper it is below the funnel, down to this depth [m].
NARROW, SLOPE, BELOW = 0.01, 1.5, 0.04
# Arms that brake move at most this share of the rest in an env step, or this distance [m].
BRAKING, CREEP = 0.6, 0.02


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


def opened(goal: Array) -> Motion:
    """Returns the motion of an open picker to a goal (..., 3) [m] at full speed."""
    full = namespace(goal).ones_like(goal[..., 2])
    return Motion(goal, full < 0.0, full)


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


def either(mask: Array, first: Motion, second: Motion) -> Motion:
    """Returns the first motion where a mask (...) is true, else the second."""
    xp = namespace(first.goal)
    goal = xp.where(mask[..., None], first.goal, second.goal)
    closed = xp.where(mask, first.closed, second.closed)
    return Motion(goal, closed, xp.where(mask, first.speed, second.speed))


def braked(start: Array, goal: Array) -> Array:
    """Returns the fraction of full speed (...) at which arms stop at a goal without overshoot.

    Args:
        start: commanded position (..., 3) [m].
        goal: (..., 3) [m].
    """
    xp = namespace(start)
    return xp.clip(BRAKING * xp.max(xp.abs(goal - start), axis=-1), CREEP, STRIDE) / STRIDE


def funnel(center: Array, end: Array, high: float, narrow: float = NARROW) -> Array:
    """Returns the goal (..., 3) [m] of a picker that moves over a position and down to it.

    Nothing changes abruptly, because averages of abrupt changes would stop those who imitate it.

    Args:
        center: position of the picker (..., 3) [m].
        end: position at which the motion ends (..., 3) [m].
        high: height far from it [m].
        narrow: radius of the funnel at the bottom [m].
    """
    xp = namespace(center)
    outside = xp.clip(lengths((end - center)[..., :2]) - narrow, 0.0, None)
    level = xp.clip(end[..., 2] + SLOPE * outside, None, high)
    share = xp.clip(1.0 - (level - center[..., 2]) / BELOW, 0.0, 1.0)
    across = center[..., :2] + share[..., None] * (end - center)[..., :2]
    return at(across, level)
