"""How two pickers lay down a cloth that hangs from its middle column, so that it is folded."""

from typing import NamedTuple

from softgym_mj.metrics import Array, namespace, taken
from softgym_mj.policies.reactive.grasps import FLOOR, TOP, Sheet, middle
from softgym_mj.policies.reactive.hands import Hands
from softgym_mj.policies.reactive.motions import at

PACE = 0.06  # [m] Distance along X in an env step.
# Cloth hangs shorter than it is and slides on the floor: the arc begins farther away than half of
# the cloth by a distance [m], and is lower by a factor. Edges touched the floor 5 cm too near
# without them.
BEYOND, LOWER = 0.07, 0.9
TUBE, STRAIGHT = 0.07, 0.06  # [m] Distances from the arc, and along Y, up to which it is followed.
ENDS = -0.05, 0.03  # [m] Distances along X before its end and beyond its beginning.
# The edges must be ahead of the middle by a share of its way, less a distance [m].
AHEAD, BEHIND = 0.6, 0.05
# [m] Height of the edges up to which the middle column is lowered at the beginning, and largest
# such distance; height at which they are so high that it waits, and difference to full pace.
TOUCHING, LOWERED = 0.02, 0.15
WAITING, GOING = 0.16, 0.1
SLOWEST = 0.1  # Smallest fraction of the pace.
TOLERANCE, MOST = 0.03, 0.3  # [m] Distance from the beginning of the arc without extra height.
RAISED = 0.1  # [m] Difference of heights over which cloth starts to move across.
ARRIVED = 0.025  # [m] Distance along X from the end of the arc at which pickers release.
LAID = 0.01  # [m] Height of pickers above the lowest, or twice that of vertices, at release.


class Laid(NamedTuple):
    """Motion of two pickers.

    Attributes:
        goal: (..., 2, 3) [m].
        closed: whether they are closed (...).
    """

    goal: Array
    closed: Array


def laying(sheet: Sheet, hands: Hands) -> Laid:
    """Returns the motion of pickers that hold both ends of the middle column.

    They carry it over the place of the outer edges, X = half of the width, and down an arc to
    X = 0, on which the edges stay in place.
    """
    xp, half = namespace(sheet.points), sheet.size[..., 0] / 2
    flat = taken(sheet.flat, hands.held)
    away = hands.places[..., :2] - flat
    longer = 1.0 + BEYOND / half
    x, aside = xp.mean(away[..., 0], axis=-1) / longer, xp.max(xp.abs(away[..., 1]), axis=-1)
    z = xp.mean(hands.places[..., 2], axis=-1)
    edges = _edges(sheet)
    along = xp.clip(x, xp.zeros_like(half), half)
    lowered = xp.clip(edges[..., 2] - TOUCHING, 0.0, LOWERED) / half

    def arc(along: Array) -> Array:
        """Returns heights (...) [m] at distances (...) [m] from its end."""
        height = xp.sqrt(xp.clip(half**2 - (half - along) ** 2, 0.0, None))
        return LOWER * height - lowered * along

    follows = edges[..., 0] - x > AHEAD * (half - along) - BEHIND
    follows = follows & (aside < STRAIGHT) & (xp.abs(z - arc(along)) < TUBE)
    follows = follows & (x > ENDS[0]) & (x < half + ENDS[1])
    down = xp.clip((WAITING - edges[..., 2]) / GOING, SLOWEST, 1.0)
    pace = PACE * xp.maximum(down, xp.clip((half - along) / GOING, 0.0, 1.0))
    ahead = xp.clip(along - pace, 0.0, None)
    extra = xp.clip(xp.maximum(xp.abs(x - half), aside) - TOLERANCE, 0.0, MOST)
    forward = longer * xp.where(follows, ahead, half)
    height = xp.where(follows, arc(ahead), half + extra)
    # Before, cloth is lifted until it can be moved across.
    lifted = (z - xp.clip(half - RAISED / 2, None, TOP - RAISED)) / RAISED + 1.0
    share = xp.where(follows, xp.ones_like(z), xp.clip(lifted, 0.0, 1.0))
    goals = []
    for i in range(2):
        center, place = hands.centers[..., i, :], hands.places[..., i, :]
        target = xp.stack([flat[..., i, 0] + forward, flat[..., i, 1]], axis=-1)
        across = center[..., :2] + share[..., None] * (target - place[..., :2])
        goals.append(at(across, xp.clip(center[..., 2] + height - place[..., 2], FLOOR, TOP)))
    low = (hands.places[..., 2] < 2 * LAID) | (hands.centers[..., 2] < FLOOR + LAID)
    done = follows & (x < ARRIVED) & low[..., 0] & low[..., 1]
    return Laid(xp.stack(goals, axis=-2), ~done)


def _edges(sheet: Sheet) -> Array:
    """Returns the mean position (..., 3) [m] of the first and the last column."""
    xp = namespace(sheet.points)
    x = xp.abs(sheet.flat[..., 0])
    return middle(sheet, x > sheet.size[..., :1] / 2 - 0.005)
