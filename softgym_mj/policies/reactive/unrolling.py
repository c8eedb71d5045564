"""How two pickers lay down a cloth that hangs from a side, so that it is spread."""

from softgym_mj.metrics import Array, lengths, namespace, taken
from softgym_mj.policies.reactive.grasps import Sheet, middle
from softgym_mj.policies.reactive.hands import Hands
from softgym_mj.policies.reactive.motions import Motion, at

LAYING = 0.75  # Fraction of full speed.
PACE = 0.06  # [m] Distance along X in an env step.
BORDER, ENDS = 0.63, 0.03  # [m] Farthest held side along X, and distance from it that is close.
SIDE = 0.33  # [m] Farthest held vertices along Y.
MIDDLE = 0.3  # [m] Farthest held side along X while it is raised.
# Held vertices are raised to the height of the cloth, or this height [m] at most.
HUNG, HIGHEST = 0.97, 0.44
# The arc to the floor is shorter than the cloth and lower by factors, and ends at this height [m]:
# the cloth would slide otherwise.
SHORTER, LOWER, CEILING = 0.92, 0.9, 0.4
# [m] Distance along Y from the stretched side, and height below the arc, up to which it is laid.
STRETCHED, BELOW = 0.1, 0.09
# [m] A free edge above this height hangs in the air, while the held side is more than a distance
# above the height of the cloth.
AIR, ABOVE = 0.08, 0.02
# [m] Distances along X of the held side from the free edge: up to which it may be raised again,
# from which it goes on in its direction, and from which it does so even if the border is near.
BEGUN, AHEAD, COMMITTED = 0.15, 0.1, 0.2
SPREAD = 0.9  # Fraction of the cloth's length behind the held side at which pickers release it.
LAID, LOW = 0.05, 0.06  # [m] Heights of held vertices, or of pickers, at release.
FREE = 0.01  # [m] Vertices that are farthest from the held side up to this distance are its edge.


def unrolling(sheet: Sheet, hands: Hands) -> list[Motion]:
    """Returns motions of pickers that hold both ends of a side.

    They stretch it along Y and raise it, then move it along X from the free edge, which rests on
    the floor, and down an arc to the floor.
    """
    xp, places = namespace(sheet.points), hands.places
    ends = taken(sheet.flat, hands.held)
    width = lengths(ends[..., 1, :] - ends[..., 0, :])
    edge, length = _free_edge(sheet, ends, width)
    x, z = xp.mean(places[..., 0], axis=-1), xp.mean(places[..., 2], axis=-1)
    order = xp.where(places[..., 0, 1] < places[..., 1, 1], -xp.ones_like(x), xp.ones_like(x))
    half = order * xp.clip(width / 2, None, SIDE)
    sides = xp.stack([half, -half], axis=-1)
    aside = xp.max(xp.abs(places[..., 1] - sides), axis=-1)
    ahead, one = x - edge[..., 0], xp.ones_like(x)
    # Towards the middle, unless the cloth lies ahead of its free edge already.
    way = xp.where(edge[..., 0] > 0.0, -one, one)
    way = xp.where(xp.abs(ahead) > AHEAD, xp.where(ahead > 0.0, one, -one), way)
    turned = (xp.abs(ahead) < COMMITTED) & (xp.abs(edge[..., 0] + way * length) > BORDER)
    way = xp.where(turned & (xp.abs(edge[..., 0] - way * length) <= BORDER), -way, way)
    ahead = way * ahead

    def arc(ahead: Array) -> Array:
        """Returns heights (...) [m] at distances (...) [m] from the free edge."""
        radius = SHORTER * length
        height = xp.sqrt(xp.clip(radius**2 - xp.clip(ahead, 0.0, None) ** 2, 0.0, None))
        return xp.clip(xp.minimum(LOWER * height, length), None, CEILING)

    low = (z < arc(ahead) - BELOW) & (ahead < BEGUN)
    narrow = aside > STRETCHED
    top = xp.clip(HUNG * length, None, HIGHEST)
    raised = narrow | ((edge[..., 2] > AIR) & (z > top + ABOVE)) | low
    top = xp.where(low & ~narrow, xp.maximum(arc(ahead), z), top)
    forward = xp.clip(x + PACE * way, -BORDER, BORDER)
    down = arc(way * (forward - edge[..., 0]))
    down = xp.where(xp.abs(forward) >= BORDER - ENDS, xp.zeros_like(down), down)
    forward = xp.where(raised, xp.clip(x, -MIDDLE, MIDDLE), forward)
    height = xp.where(raised, top, down)
    there = (ahead > SPREAD * length) | (xp.abs(x) > BORDER - 2.0 * ENDS)
    there = there & ((z < LAID) | (xp.mean(hands.centers[..., 2], axis=-1) < LOW))
    motions = []
    for i in range(2):
        move = xp.stack([forward, sides[..., i]], axis=-1) - places[..., i, :2]
        center = hands.centers[..., i, :]
        goal = at(center[..., :2] + move, center[..., 2] + height - places[..., i, 2])
        motions.append(Motion(goal, narrow | ~there, LAYING * one))
    return motions


def _free_edge(sheet: Sheet, ends: Array, width: Array) -> tuple[Array, Array]:
    """Returns the mean position (..., 3) [m] of the free edge, and its distance (...) [m].

    Args:
        sheet: the cloth.
        ends: of the held side in the flat cloth (..., 2, 2) [m].
        width: their distance (...) [m].
    """
    xp = namespace(sheet.points)
    across = (ends[..., 1, :] - ends[..., 0, :]) / xp.clip(width, 1e-6, None)[..., None]
    away = sheet.flat - xp.mean(ends, axis=-2)[..., None, :]
    away = xp.abs(away[..., 0] * across[..., None, 1] - away[..., 1] * across[..., None, 0])
    away = xp.where(sheet.present, away, xp.zeros_like(away))
    length = xp.max(away, axis=-1)
    return middle(sheet, away > length[..., None] - FREE), length
