"""Reactive expert of FoldCloth: carries the corners of column 0 to their mirror images.

A held corner moves on the flattened half circle through its present place that ends upright at
its mirror image. Nothing else about the way has to be remembered.
"""

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.hands import Hands, found_hands
from softgym_mj.policies.reactive.motions import Motion, actions, at, funnel

LOW = 0.05  # [m] Height of pickers that grasp.
HOVER = 0.12  # [m] Height of pickers on their way to a corner.
READY, NEAR = 0.03, 0.02  # [m] Horizontal distance and height above LOW from which they close.
LOWER = 0.8  # Height of the way as a fraction of the circle's: higher corners drag the cloth.
PACE = 0.05  # [m] Way of a corner in an env step.
SHORT, LANDING = 0.005, 0.018  # [m] Distance before the mirror image, and height, of a release.
ARRIVED = 0.012  # [m] Distance from there up to which pickers release.
FOLDED = 0.1  # [m] Distance of a corner from its mirror image up to which it is folded.
REST = 0.2  # [m] Height of idle pickers.


def fold_cloth(observation: Array) -> Array:
    """Returns actions (..., 8) of FoldCloth for "markov" (..., 26)."""
    xp, lead = namespace(observation), observation.shape[:-1]
    corners = observation[..., :12].reshape((*lead, 4, 3))
    hands = found_hands(observation[..., 12:], corners)
    swapped = _swapped(hands, corners)
    both = hands.holds[..., 0] & hands.holds[..., 1]
    # Unit vector from the mirror images to the corners that are folded, across the far edge.
    edge = corners[..., 3, :2] - corners[..., 2, :2]
    normal = xp.stack([edge[..., 1], -edge[..., 0]], axis=-1)
    normal = normal / xp.clip(lengths(normal), 1e-6, None)[..., None]
    away = xp.mean(corners[..., :2, :2] - corners[..., 2:, :2], axis=-2)
    side = xp.where(xp.sum(normal * away, axis=-1) < 0.0, -1.0, 1.0)
    motions = []
    for i in range(2):
        own = xp.where(swapped[..., None], corners[..., 1 - i, :], corners[..., i, :])
        mirror = xp.where(swapped[..., None], corners[..., 3 - i, :], corners[..., 2 + i, :])
        motions.append(_motion(hands, i, both, own, mirror, side[..., None] * normal))
    return actions(hands.centers, motions)


def _swapped(hands: Hands, corners: Array) -> Array:
    """Returns whether picker 0 takes corner 1, and picker 1 corner 0 (...)."""
    ways = lengths(hands.centers[..., :, None, :2] - corners[..., None, :2, :2])
    nearer = ways[..., 0, 1] + ways[..., 1, 0] < ways[..., 0, 0] + ways[..., 1, 1]
    held = [hands.holds[..., i] & (hands.held[..., i] == 1 - i) for i in range(2)]
    right = [hands.holds[..., i] & (hands.held[..., i] == i) for i in range(2)]
    return held[0] | held[1] | (nearer & ~(right[0] | right[1]))


def _motion(hands: Hands, i: int, both: Array, own: Array, mirror: Array, normal: Array) -> Motion:
    """Returns the motion of picker `i`, whose corner is to be carried to its mirror image."""
    xp, center, place = namespace(own), hands.centers[..., i, :], hands.places[..., i, :]
    full, holds = xp.ones_like(own[..., 0]), hands.holds[..., i]
    following, left = _carried(place, mirror, normal)
    carried = center + xp.where(both[..., None], following - place, xp.zeros_like(place))
    keeps = holds & ~(both & (left < ARRIVED))
    corner = at(own[..., :2], LOW * full)
    gap = lengths((center - corner)[..., :2])
    closes = (gap < READY) & (center[..., 2] < LOW + NEAR) & ~hands.lost[..., i]
    folded = lengths((own - mirror)[..., :2]) < FOLDED
    rest = at(center[..., :2], REST * full)
    free = xp.where(folded[..., None], rest, funnel(center, corner, HOVER))
    goal = xp.where(keeps[..., None], carried, free)
    return Motion(goal, xp.where(holds, keeps, closes & ~folded), full)


def _carried(place: Array, mirror: Array, normal: Array) -> tuple[Array, Array]:
    """Returns where a corner at `place` is an env step later (..., 3), and the way left (...) [m].

    Args:
        place: (..., 3) [m].
        mirror: its mirror image (..., 3) [m].
        normal: horizontal unit vector from there to the corner's side (..., 2).
    """
    xp = namespace(place)
    end = mirror[..., :2] + SHORT * normal
    across = xp.clip(xp.sum((place[..., :2] - end) * normal, axis=-1), 1e-3, None)
    height = xp.clip(place[..., 2] - LANDING, 0.0, None) / LOWER
    radius = (across**2 + height**2) / (2 * across)
    angle = xp.clip(xp.atan2(height, radius - across) - PACE / radius, 0.0, None)
    along, up = radius * (1.0 - xp.cos(angle)), LANDING + LOWER * radius * xp.sin(angle)
    return at(end + along[..., None] * normal, up), across + height
