"""Reactive expert of FoldCloth: carries the corners of column 0 to their mirror images.

A held corner moves on the flattened half circle through its present place that ends upright at
its mirror image. Nothing else about the way has to be remembered. Arms grasp the sides of the cloth
next to corners that are out of reach.
"""

from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.hands import Hands, cross, found_hands
from softgym_mj.policies.reactive.motions import Motion, actions, at, braked, funnel
from softgym_mj.policies.reactive.reach import way_into_reach


class Manner(NamedTuple):
    """Manner in which pickers or arms fold, with the pickers' values.

    Attributes:
        low: height at which they grasp [m].
        ready, near: horizontal distance and height above `low` from which they close [m].
        lower: height of the way as a fraction of the circle's: higher corners drag the cloth.
        pace: way of a corner in an env step [m].
        landing: height of a release [m].
        folded: distance of a corner from its mirror image up to which it is folded [m].
    """

    low: float = 0.05
    ready: float = 0.03
    near: float = 0.02
    lower: float = 0.8
    pace: float = 0.05
    landing: float = 0.018
    folded: float = 0.1


PICKERS = Manner()
# Tool points are at least 24 mm high, and hold a vertex in themselves. Corners beside their grasps
# stay behind their mirror images.
ARMS = Manner(low=0.025, ready=0.02, near=0.01, lower=0.6, pace=0.03, landing=0.025, folded=0.2)
HOVER = 0.12  # [m] Height of pickers on their way to a corner.
SHORT, ARRIVED = 0.005, 0.012  # [m] Distance before the mirror image, and from there, of a release.
REST = 0.2  # [m] Height of idle pickers.
# [m] Largest distance of a grasp from its corner. A corner that is nearer to its mirror image than
# the second is grasped again, even if the mirror image is out of reach.
BESIDE, AGAIN = 0.2, 0.3


def fold_cloth(observation: Array) -> Array:
    """Returns actions (..., 8) of FoldCloth for "markov" (..., 26), of two arms (..., n)."""
    xp, lead = namespace(observation), observation.shape[:-1]
    corners = observation[..., :12].reshape((*lead, 4, 3))
    hands = found_hands(observation[..., 12:], corners, arms=True)
    manner = ARMS if hands.are_arms else PICKERS
    swapped = _swapped(hands, corners)
    both = hands.holds[..., 0] & hands.holds[..., 1]
    # Unit vector from the mirror images to the corners that are folded, across the far edge.
    edge = corners[..., 3, :2] - corners[..., 2, :2]
    normal = xp.stack([edge[..., 1], -edge[..., 0]], axis=-1)
    normal = normal / xp.clip(lengths(normal), 1e-6, None)[..., None]
    away = xp.mean(corners[..., :2, :2] - corners[..., 2:, :2], axis=-2)
    side = xp.where(xp.sum(normal * away, axis=-1) < 0.0, -1.0, 1.0)
    normal = side[..., None] * normal
    folded = lengths((corners[..., :2, :] - corners[..., 2:, :])[..., :2]) < manner.folded
    if hands.are_arms:  # One of them may mend its half of the fold.
        both = both | folded[..., 0] | folded[..., 1]
    motions = []
    for i in range(2):
        own = xp.where(swapped[..., None], corners[..., 1 - i, :], corners[..., i, :])
        mirror = xp.where(swapped[..., None], corners[..., 3 - i, :], corners[..., 2 + i, :])
        done = xp.where(swapped, folded[..., 1 - i], folded[..., i])
        if hands.are_arms:
            own, mirror = _in_reach(hands, i, own, mirror, normal)
        motions.append(_motion(hands, i, both, done, own, mirror, normal))
    return actions(hands.commanded, motions)


def _swapped(hands: Hands, corners: Array) -> Array:
    """Returns whether picker 0 takes corner 1, and picker 1 corner 0 (...).

    Arms take the corners on their sides.
    """
    if hands.are_arms:
        return corners[..., 2, 1] > corners[..., 3, 1]
    nearer = cross(hands, corners[..., :2, :])
    held = [hands.holds[..., i] & (hands.held[..., i] == 1 - i) for i in range(2)]
    right = [hands.holds[..., i] & (hands.held[..., i] == i) for i in range(2)]
    return held[0] | held[1] | (nearer & ~(right[0] | right[1]))


def _in_reach(
    hands: Hands, i: int, own: Array, mirror: Array, normal: Array
) -> tuple[Array, Array]:
    """Returns the point that arm `i` grasps, and where it carries what it holds (..., 3) [m].

    They lie on the side of the cloth, at a distance from the corner and its mirror image that is
    zero if the arm reaches both. A held point keeps its distance from the corner.
    """
    xp = namespace(own)
    ways = [
        xp.clip(way_into_reach(i, *each), None, BESIDE)
        for each in ((own, -normal), (mirror, normal))
    ]
    far = lengths((own - mirror)[..., :2]) > AGAIN
    grasp = xp.where(far, xp.maximum(ways[0], ways[1]), ways[0])
    held = xp.clip(lengths(hands.places[..., i, :] - own), None, BESIDE)
    carried = xp.maximum(xp.where(hands.holds[..., i], held, grasp), ways[1])
    own = at(own[..., :2] - grasp[..., None] * normal, own[..., 2])
    return own, at(mirror[..., :2] + carried[..., None] * normal, mirror[..., 2])


def _motion(
    hands: Hands, i: int, both: Array, folded: Array, own: Array, mirror: Array, normal: Array
) -> Motion:
    """Returns the motion of picker `i`, whose corner is to be carried to its mirror image."""
    xp, center, place = namespace(own), hands.centers[..., i, :], hands.places[..., i, :]
    manner, commanded = ARMS if hands.are_arms else PICKERS, hands.commanded[..., i, :]
    full, holds = xp.ones_like(own[..., 0]), hands.holds[..., i]
    across, height = _left(manner, place, mirror, normal)
    arrived = (across + height < ARRIVED) & (both | hands.are_arms)
    place = place + (commanded - center)
    following = _carried(manner, place, mirror, normal)
    carried = commanded + xp.where(both[..., None], following - place, xp.zeros_like(place))
    keeps = holds & ~arrived
    corner = at(own[..., :2], manner.low * full)
    gap = lengths((center - corner)[..., :2])
    is_low = center[..., 2] < manner.low + manner.near
    closes = (gap < manner.ready) & is_low & ~hands.lost[..., i]
    rest = at(commanded[..., :2], REST * full)
    free = xp.where(folded[..., None], rest, funnel(center, corner, HOVER))
    goal = xp.where(keeps[..., None], carried, free)
    speed = xp.where(keeps, full, braked(commanded, goal)) if hands.are_arms else full
    return Motion(goal, xp.where(holds, keeps, closes & ~folded), speed)


def _left(manner: Manner, place: Array, mirror: Array, normal: Array) -> tuple[Array, Array]:
    """Returns the ways left from `place` along `normal`, and down on the full circle (...) [m].

    The arguments are those of `_carried`.
    """
    xp = namespace(place)
    end = mirror[..., :2] + SHORT * normal
    across = xp.clip(xp.sum((place[..., :2] - end) * normal, axis=-1), 1e-3, None)
    return across, xp.clip(place[..., 2] - manner.landing, 0.0, None) / manner.lower


def _carried(manner: Manner, place: Array, mirror: Array, normal: Array) -> Array:
    """Returns where a corner at `place` is an env step later (..., 3) [m].

    Args:
        manner: manner of the pickers.
        place: (..., 3) [m].
        mirror: its mirror image (..., 3) [m].
        normal: horizontal unit vector from there to the corner's side (..., 2).
    """
    xp = namespace(place)
    across, height = _left(manner, place, mirror, normal)
    radius = (across**2 + height**2) / (2 * across)
    angle = xp.clip(xp.atan2(height, radius - across) - manner.pace / radius, 0.0, None)
    along = radius * (1.0 - xp.cos(angle))
    up = manner.landing + manner.lower * radius * xp.sin(angle)
    return at(mirror[..., :2] + SHORT * normal + along[..., None] * normal, up)
