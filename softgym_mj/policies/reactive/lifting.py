"""How two pickers take the corners of a side of crumpled cloth, so that it hangs from them."""

from softgym_mj.metrics import Array, constant, lengths, namespace
from softgym_mj.policies.reactive.approach import approached
from softgym_mj.policies.reactive.corner_grasps import EXPOSED, corner_grips, of_a_side
from softgym_mj.policies.reactive.grasps import REACH, TOP, Sheet, entry
from softgym_mj.policies.reactive.hands import Hands, point_at
from softgym_mj.policies.reactive.motions import Motion, at, either, opened

# Fractions of full speed at which cloth is lifted, and while the other picker fetches an exposed
# corner: it would chase the corner, which imitators do not learn.
LIFTING, SLOWLY = 0.8, 0.1
DROPPED = 0.43  # [m] Height of a picker from which it drops the cloth.
# [m] Free pickers wait at a height, aside, while the other one takes the highest vertex; or over
# and beside a corner that is hidden, until the other one has lifted it.
WAITING, ASIDE, OVER, BESIDE = 0.3, 0.1, 0.1, 0.15
SIDES = (0, 1), (0, 2), (1, 3), (2, 3), (1, 0), (2, 0), (3, 1), (3, 2)  # Corners of a side.


def lifting(sheet: Sheet, hands: Hands, corners: Array) -> list[Motion]:
    """Returns motions that end when both pickers hold corners of a side.

    A picker that holds the cloth lifts it while the other one fetches a corner, the next one if it
    holds a corner. If none is exposed, it drops the cloth; if no picker holds it, the nearer one
    takes the highest vertex.

    Args:
        sheet: the cloth.
        hands: the pickers.
        corners: corner that each holds, or -1 (..., 2).
    """
    xp, found = namespace(sheet.points), corner_grips(sheet, hands)
    holds, heights = hands.holds, hands.centers[..., 2]
    alike = (corners[..., 0] >= 0) == (corners[..., 1] >= 0)
    better = xp.where(alike, heights[..., 0] >= heights[..., 1], corners[..., 0] >= 0)
    first = holds[..., 0] & (~holds[..., 1] | better)
    keeps = first, holds[..., 1] & ~first
    wanted = _wanted(found.values, corners, ~holds[..., 0] & ~holds[..., 1])
    levels = xp.where(sheet.present, sheet.points[..., 2], -xp.ones_like(sheet.points[..., 2]))
    highest = point_at(sheet.points, xp.argmax(levels, axis=-1))
    ways = lengths((hands.centers - highest[..., None, :])[..., :2])
    nearer = ways[..., 0] <= ways[..., 1]
    up = constant([0.0, 0.0, 1.0], highest)
    motions = []
    for i in range(2):
        center, (index, value) = hands.centers[..., i, :], wanted[i]
        full, hidden = xp.ones_like(value), value <= EXPOSED
        grasp, direction = found.best(i, index)
        fetch = Motion(*approached(hands, i, grasp, direction), full)
        beside = grasp[..., :2] + BESIDE * _direction(center - grasp)
        beside = opened(at(beside, xp.clip(grasp[..., 2], OVER, None)))
        away = ASIDE * xp.sign(center - hands.centers[..., 1 - i, :])
        aside = opened(at((center + away)[..., :2], WAITING * full))
        top = Motion(*approached(hands, i, highest + REACH * up, up), full)
        alone = either(nearer if i == 0 else ~nearer, top, aside)
        free = either(hidden, either(keeps[1 - i], beside, alone), fetch)
        single, shown = ~holds[..., 1 - i], wanted[1 - i][1] > EXPOSED
        goal = at(center[..., :2] * constant([0.0, 0.5], center), TOP * full)
        pace = xp.where(single & shown, SLOWLY * full, LIFTING * full)
        lift = Motion(goal, ~(single & ~shown & (center[..., 2] >= DROPPED)), pace)
        motions.append(either(keeps[i], lift, either(holds[..., i], opened(center), free)))
    return motions


def _wanted(values: Array, corners: Array, both: Array) -> list[tuple[Array, Array]]:
    """Returns the corner that each picker fetches (...), and the value of its grasp (...).

    Args:
        values: of grasps (..., 2, 4).
        corners: that pickers hold, or -1 (..., 2).
        both: whether both are free (...): they fetch the corners of a side.
    """
    xp, number = namespace(values), constant([0, 1, 2, 3], corners)
    sums = [values[..., 0, a] + values[..., 1, b] for a, b in SIDES]
    side, wanted = xp.argmax(xp.stack(sums, axis=-1), axis=-1), []
    for i in range(2):
        value, other = values[..., i, :], corners[..., 1 - i, None]
        barred = (other >= 0) & ~of_a_side(number, other)
        index = xp.argmax(xp.where(barred, xp.full_like(value, -xp.inf), value), axis=-1)
        index = xp.where(both, constant([each[i] for each in SIDES], values)[side], index)
        wanted.append((index, entry(value, index)))
    return wanted


def _direction(away: Array) -> Array:
    """Returns horizontal directions (..., 2) of vectors (..., 3) [m]."""
    return away[..., :2] / (lengths(away[..., :2])[..., None] + 1e-3)
