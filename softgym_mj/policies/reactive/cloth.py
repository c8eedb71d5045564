"""Reactive expert of FoldCrumpledCloth: lifts the middle column by its ends and lays it down.

Cloth that hangs from both ends of its middle column is folded. A picker that holds another vertex
lifts it until the other picker has an end, then fetches the opposite one.
"""

from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace, taken
from softgym_mj.policies.reactive.approach import approached
from softgym_mj.policies.reactive.grasps import (
    TOP,
    Grasps,
    Sheet,
    entries,
    entry,
    find_grasps,
    parsed,
)
from softgym_mj.policies.reactive.hands import Hands, point_at
from softgym_mj.policies.reactive.laying import laying
from softgym_mj.policies.reactive.motions import Motion, actions, at

LIFTING, LAYING = 0.8, 0.6  # Fractions of full speed at which one or both pickers move cloth.
DRAGGED = 0.3  # [m] Height at which an end is dragged.
REST = 0.2  # [m] Height of idle pickers.
FOLDED = 0.35  # Error of a fold as a fraction of the cloth's mean side, up to which pickers rest.
END = 0.1  # [m] Cost up to which a vertex counts as an end.
# [m] Cost that a held vertex may exceed the best exposed one by: cloth that hangs from two vertices
# shows its ends.
BETTER = 0.05


class Holds(NamedTuple):
    """Vertices that pickers hold.

    Attributes:
        ends: end of the middle column that each holds or is nearest to (..., 2).
        good: whether each holds an end, or nothing nearer to it is exposed (..., 2).
        stays: whether each keeps what it holds (..., 2).
    """

    ends: Array
    good: Array
    stays: Array


def fold_crumpled_cloth(observation: Array) -> Array:
    """Returns actions (..., 8) of FoldCrumpledCloth for "full", followed by "markov" (..., n)."""
    xp = namespace(observation)
    # Distances of many points need more than the 11 bits of fast products of a GPU.
    sheet, hands = parsed(xp.astype(observation, xp.float64))
    grasps = find_grasps(sheet, hands)
    best = xp.argmax(grasps.values, axis=-1)
    holds = _holds(sheet, hands, grasps, best)
    both = holds.good[..., 0] & holds.good[..., 1]
    rests = (_error(sheet) <= FOLDED) & ~(hands.holds[..., 0] & hands.holds[..., 1])
    laid = laying(sheet, hands)
    motions = []
    for i in range(2):
        center, stays = hands.centers[..., i, :], holds.stays[..., i]
        goal, closed = _fetched(hands, holds, grasps, best, i)
        lifted = _lifted(sheet, holds, center, i)
        carried = xp.where(both[..., None], laid.goal[..., i, :], lifted)
        goal = xp.where(stays[..., None], carried, goal)
        closed = xp.where(stays, ~both | laid.closed, closed & ~hands.holds[..., i])
        goal = xp.where(
            rests[..., None], at(center[..., :2], xp.full_like(goal[..., 2], REST)), goal
        )
        full = xp.ones_like(center[..., 2])
        speed = xp.where(both, LAYING * full, LIFTING * full)
        speed = xp.where(stays & ~rests, speed, full)
        motions.append(Motion(goal, closed & ~rests, speed))
    return xp.astype(actions(hands.centers, motions), observation.dtype)


def _lifted(sheet: Sheet, holds: Holds, center: Array, i: int) -> Array:
    """Returns the goal (..., 3) [m] of picker `i`, which holds the cloth alone.

    An end is dragged to its side of the goal, so that the opposite end trails behind; another
    vertex is raised, so that the ends appear.
    """
    xp = namespace(center)
    side = 1.0 - 2.0 * xp.astype(holds.ends[..., i], center.dtype)
    across = xp.stack([0.5 * center[..., 0], side * sheet.size[..., 1] / 2], axis=-1)
    height = xp.full_like(side, DRAGGED)
    dragged, raised = at(across, height), at(0.5 * center[..., :2], xp.full_like(height, TOP))
    return xp.where(holds.good[..., i, None], dragged, raised)


def _error(sheet: Sheet) -> Array:
    """Returns the error (...) of the fold as a fraction of the cloth's mean side.

    It is the mean distance of the pairs plus 1.2 times the displacement of the second half.
    """
    xp = namespace(sheet.points)
    index = xp.cumulative_sum(xp.astype(sheet.present, xp.int64), axis=-1) - 1
    columns = sheet.columns[..., None]
    column = index % columns
    mirrored = taken(sheet.points, index + columns - 1 - 2 * column)
    counts = xp.astype(sheet.present & (2 * column > columns - 1), sheet.points.dtype)
    places = at(sheet.flat, xp.zeros_like(sheet.flat[..., 0]))
    errors = lengths(sheet.points - mirrored) + 1.2 * lengths(sheet.points - places)
    mean = xp.sum(errors * counts, axis=-1) / xp.sum(counts, axis=-1)
    return mean / xp.mean(sheet.size, axis=-1)


def _holds(sheet: Sheet, hands: Hands, grasps: Grasps, best: Array) -> Holds:
    """Returns what pickers hold; `best` is the best grasp of each for either end (..., 2, 2)."""
    xp = namespace(sheet.points)
    costs = xp.stack([entries(sheet.costs[..., e, :], hands.held) for e in range(2)], axis=-1)
    ends, least = xp.argmin(costs, axis=-1), xp.min(costs, axis=-1)
    two = hands.holds[..., 0] & hands.holds[..., 1]
    # If both are near the same end, the farther one counts for the other end.
    same = two & (ends[..., 0] == ends[..., 1])
    farther = least[..., 0] > least[..., 1]
    moved = xp.stack([same & farther, same & ~farther], axis=-1)
    ends = xp.where(moved, 1 - ends, ends)
    cost = entry(costs, ends)
    exposed = [
        [entry(grasps.costs[..., e, :], best[..., i, e]) for e in range(2)] for i in range(2)
    ]
    shown = xp.stack([xp.stack(each, axis=-1) for each in exposed], axis=-2)
    near = cost <= entry(shown, ends) + BETTER
    good = hands.holds & ((cost <= END) | (near & two[..., None]))
    worth = xp.where(hands.holds, 10.0 * xp.astype(good, cost.dtype) - cost, -xp.inf)
    second = worth[..., 1] > worth[..., 0]
    chosen = xp.stack([~second, second], axis=-1) | (good[..., :1] & good[..., 1:])
    return Holds(ends, good, hands.holds & chosen)


def _fetched(
    hands: Hands, holds: Holds, grasps: Grasps, best: Array, i: int
) -> tuple[Array, Array]:
    """Returns the goal (..., 3) [m] of free picker `i`, and whether it closes (...)."""
    xp, other = namespace(best), 1 - i
    top = xp.max(grasps.values, axis=-1)
    direct = top[..., 0, 0] + top[..., 1, 1] >= top[..., 0, 1] + top[..., 1, 0]
    end = xp.where(direct, i, other)
    better = xp.where(top[..., i, 1] > top[..., i, 0], 1, 0)
    end = xp.where(hands.holds[..., other], better, end)
    end = xp.where(holds.good[..., other], 1 - holds.ends[..., other], end)
    second, index = (end == 1)[..., None], entry(best[..., i, :], end)
    centers, directions = (
        [point_at(each[..., e, :, :], index) for e in range(2)]
        for each in (grasps.centers, grasps.directions)
    )
    grasp = xp.where(second, centers[1], centers[0])
    direction = xp.where(second, directions[1], directions[0])
    return approached(hands, i, grasp, direction)
