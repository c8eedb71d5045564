"""How pickers mend cloth that lies almost flat: they pull corners and sides to their places."""

from softgym_mj.metrics import Array, constant, lengths, mean, namespace, taken
from softgym_mj.policies.reactive.approach import approached
from softgym_mj.policies.reactive.corner_grasps import EDGES, EXPOSED, grips, marks_of
from softgym_mj.policies.reactive.flat_fit import Fit
from softgym_mj.policies.reactive.grasps import WAY, Sheet
from softgym_mj.policies.reactive.hands import Hands, point_at
from softgym_mj.policies.reactive.motions import Motion, at, either, opened

DRAGGING = 0.6  # Fraction of full speed.
REST = 0.3  # [m] Height of pickers at rest.
APART = 0.15  # [m] Distance in the cloth from which both pickers take vertices.
# [m] Distance from its place up to which a vertex lies flat. Cloth lies almost flat if more than a
# share of its vertices does; beyond a larger share nothing else has to be moved.
NEAR, FLAT, GOOD = 0.05, 0.5, 0.9
# [m] Distances from their places from which vertices are moved, and up to which they are held.
MISPLACED, HELD = 0.04, 0.03
LOW, DOWN = 0.04, 0.06  # [m] Heights of a vertex, or of its picker, up to which it is released.
STEEP, HIGHEST = 0.5, 0.15  # Height of a dragged vertex per distance from its place, and limit [m].


def mending(sheet: Sheet, hands: Hands, fit: Fit) -> tuple[list[Motion], Array]:
    """Returns motions, and whether the cloth lies almost flat and they are of use (...).

    Args:
        sheet: the cloth.
        hands: the pickers.
        fit: the flat cloth.
    """
    xp, marks = namespace(sheet.points), marks_of(sheet)
    found, flat = grips(sheet, hands, marks), taken(sheet.flat, marks)
    away = lengths(taken(fit.places, marks) - taken(sheet.points, marks)[..., :2])
    able = (found.values > EXPOSED) & (away > MISPLACED)[..., None, :]
    ways = lengths((found.centers - hands.centers[..., :, None, :])[..., :2])
    values = xp.where(able, away[..., None, :] - WAY * ways, xp.full_like(ways, -xp.inf))
    held, places = taken(sheet.flat, hands.held), taken(fit.places, hands.held)
    off = lengths(places - taken(sheet.points, hands.held)[..., :2]) >= HELD
    moves = xp.any(hands.holds & off, axis=-1) | xp.any(xp.any(able, axis=-1), axis=-1)
    near, present = (xp.astype(each, away.dtype) for each in (fit.errors < NEAR, sheet.present))
    share, motions = mean(near, present), []
    # The picker with the better grasp chooses first. The other one keeps off its vertex, and both
    # off what the other one holds.
    best, index = xp.max(values, axis=-1), xp.argmax(values, axis=-1)
    first = best[..., 0] >= best[..., 1]
    for i, chooses in enumerate((first, ~first)):
        center, full = hands.centers[..., i, :], xp.ones_like(share)
        occupied = hands.holds[..., 1 - i]
        fetched = point_at(flat, index[..., 1 - i])
        other = xp.where(occupied[..., None], held[..., 1 - i, :], fetched)
        beside = lengths(flat - other[..., None, :]) < APART
        close = (occupied | ~chooses)[..., None] & beside
        value = xp.where(close, xp.full_like(away, -xp.inf), values[..., i, :])
        chosen, fetches = xp.argmax(value, axis=-1), xp.max(value, axis=-1) > -xp.inf
        fetch = Motion(*approached(hands, i, *found.best(i, chosen)), full)
        free = either(fetches, fetch, opened(at(center[..., :2], REST * full)))
        drag = _dragged(hands, i, places[..., i, :] - hands.places[..., i, :2])
        motions.append(either(hands.holds[..., i], drag, free))
    return motions, (share > FLAT) & (moves | (share >= GOOD))


def _dragged(hands: Hands, i: int, way: Array) -> Motion:
    """Returns the motion of picker `i` that drags a vertex a way (..., 2) [m] to its place."""
    xp, center, edge = namespace(way), hands.centers[..., i, :], constant(EDGES, way)
    move = xp.maximum(xp.minimum(center[..., :2] + way, edge), -edge) - center[..., :2]
    left, height = lengths(move), hands.places[..., i, 2]
    level = center[..., 2] - height + xp.clip(STEEP * left, 0.0, HIGHEST)
    there = (left < HELD) & ((height < LOW) | (center[..., 2] < DOWN))
    return Motion(at(center[..., :2] + move, level), ~there, DRAGGING * xp.ones_like(left))
