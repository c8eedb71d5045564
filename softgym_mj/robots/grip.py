"""Rules of grips: SoftGym's in `step_grips` (docs/softgym.md 2.4), and release under load."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from array_api_compat import device

from softgym_mj.metrics import Array, namespace

# Values of `GripState.held` without a vertex: nothing; nothing until the gripper has opened.
NONE, SLIPPED = -1, -2


class GripState(NamedTuple):
    """State of n grippers.

    Attributes:
        center: positions (..., n, 3) [m].
        held: the vertex that each holds, or `NONE` or `SLIPPED` (..., n).
        offset: displacement of the held vertex from the center (..., n, 3) [m].
        dropped: number of holds that have ended in this episode (...).
    """

    center: Array
    held: Array
    offset: Array
    dropped: Array


class GripCommand(NamedTuple):
    """Command to n grippers in a sim step.

    Attributes:
        displacement: (..., n, 3) [m].
        closed: whether the grip is on (..., n) bool.
    """

    displacement: Array
    closed: Array


class GripLimits(NamedTuple):
    """Limits of grippers.

    Attributes:
        low, high: range of their centers (..., n, 3) [m].
        reach: largest distance of a vertex that they can take [m].
    """

    low: Array
    high: Array
    reach: float


def remembered(state: GripState) -> Array:
    """Returns (..., 4n): for each gripper, 1 or 0 for holding, and the held vertex's offset [m].

    -1 marks a gripper that lost its hold and takes nothing until it has opened.
    """
    xp = namespace(state.center)
    held = state.held[..., None]
    holds = xp.where(held < 0, held - NONE, 1)  # Half as long as `clip`.
    offsets = state.offset * (held >= 0)
    each = xp.concat([xp.astype(holds, offsets.dtype), offsets], axis=-1)
    return each.reshape((*state.held.shape[:-1], -1))


def step_grips(
    state: GripState,
    command: GripCommand,
    points: Callable[[Array], Array],
    present: Array | None,
    limits: GripLimits,
) -> GripState:
    """Returns the state of grippers after a sim step; changes none of its arguments.

    First, grippers whose grip is off release their vertex. All move by their displacement, within
    the limits. Then, in order, each that is closed and holds nothing grasps the vertex nearest to
    its previous center, within its reach, that no other holds; the lowest index wins a tie. After a
    release under load, a gripper grasps nothing until it has opened.

    Args:
        state: previous state.
        command: command of the sim step.
        points: returns for centers (..., n, 3) the positions of all vertices relative to each (...,
            n, vertices, 3) [m]; called only if something may be taken.
        present: whether there is such a vertex (..., vertices) bool; None for all.
        limits: limits of the grippers.

    Returns:
        The new state.
    """
    xp = namespace(state.center)
    center = xp.maximum(xp.minimum(state.center + command.displacement, limits.high), limits.low)
    held, dropped, free = state.held, state.dropped, state.held == NONE
    if may_be(xp, ~(command.closed | free)):
        held = xp.where(command.closed, held, NONE)
        dropped = dropped + (held < state.held).sum(-1)
    result = GripState(center, held, state.offset, dropped)
    seeking = command.closed & free
    if not may_be(xp, seeking):
        return result
    offsets = points(state.center)
    squares = offsets * offsets  # Summed one by one, because libraries sum in various orders.
    distances = squares[..., 0] + squares[..., 1] + squares[..., 2]
    within = seeking[..., None] & (distances <= limits.reach**2)
    if present is not None:
        within = within & present[..., None, :]
    if not may_be(xp, within):
        return result
    return _taken(xp, result, offsets, xp.where(within, distances, xp.inf))


def kept_in_order(
    holds: Sequence[Any],
    distance: Callable[[int, int], Any],
    gap: Callable[[int, int], Any],
    may: Callable[[Any], bool] = bool,
) -> list[Any]:
    """Returns which holds stay: one that pulls too far from an earlier one that stays is released.

    Args:
        holds: whether there is a hold, of n grippers in the order in which they took their
            vertices: a bool, or an array (num_envs,) of them, each.
        distance: returns the distance of two holds [m], by their places in that order.
        gap: returns the largest distance of two holds [m].
        may: whether any entry of a mask may be true.
    """
    kept = list(holds)
    for second in range(len(kept)):
        for first in range(second):
            both = kept[first] & kept[second]
            if may(both):
                apart = distance(first, second) > gap(first, second)
                kept[second] = kept[second] ^ (both & apart)
    return kept


def may_be(xp: Any, mask: Array) -> bool:
    """Returns False for a NumPy mask without True; on a GPU the test would cost too much."""
    return xp is not np or bool(np.count_nonzero(mask))


def _taken(xp: Any, state: GripState, offsets: Array, distances: Array) -> GripState:
    """Returns the state after each gripper, in order, took the nearest free vertex, if any.

    Args:
        xp: the arrays' namespace.
        state: previous state.
        offsets: vertices relative to the grippers (..., n, vertices, 3) [m].
        distances: from the grippers (..., n, vertices); infinite for vertices that cannot be taken.
    """
    held, offset = xp.asarray(state.held, copy=True), xp.asarray(state.offset, copy=True)
    vertices = xp.arange(distances.shape[-1], device=device(held))
    for i in range(held.shape[-1]):
        if not may_be(xp, xp.isfinite(distances[..., i, :])):
            continue
        taken = (held[..., None] == vertices).any(-2)
        own = xp.where(taken, xp.inf, distances[..., i, :])
        nearest = own.argmin(-1)[..., None]
        takes = xp.isfinite(xp.take_along_axis(own, nearest, axis=-1))
        place = xp.take_along_axis(offsets[..., i, :, :], nearest[..., None], axis=-2)[..., 0, :]
        held[..., i] = xp.where(takes, nearest, held[..., i, None])[..., 0]
        offset[..., i, :] = xp.where(takes, place, offset[..., i, :])
    return state._replace(held=held, offset=offset)
