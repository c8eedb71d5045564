"""How a picker approaches a grasp, for reactive experts of crumpled cloth."""

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.hands import Hands
from softgym_mj.policies.reactive.motions import at

# [m] Distances from a grasp, across its direction and along it, up to which a picker is closed,
# before the vertex is in reach: imitators never learned to close for a moment only.
READY, HIGH = 0.04, 0.1
# Pickers approach a grasp in a funnel along its direction: radius at the bottom [m], slope and
# height [m]. Beyond a horizontal distance [m] they keep above the cloth, with a slope and a height
# [m].
NARROW, SLOPE, STANDOFF = 0.012, 1.5, 0.06
AROUND, RISE, OVER = 0.12, 0.7, 0.2


def approached(hands: Hands, i: int, grasp: Array, direction: Array) -> tuple[Array, Array]:
    """Returns the goal (..., 3) [m] of free picker `i`, and whether it is closed (...).

    Args:
        hands: the pickers.
        i: number of the picker.
        grasp: center of the picker that grasps (..., 3) [m].
        direction: unit vector from the vertex to it (..., 3).
    """
    xp, away = namespace(grasp), hands.centers[..., i, :] - grasp
    axial = xp.sum(away * direction, axis=-1)[..., None]
    aside = lengths(away - axial * direction)
    level = xp.clip(SLOPE * (aside - NARROW), 0.0, STANDOFF)[..., None]
    over = xp.clip(RISE * (lengths(away[..., :2]) - AROUND), 0.0, OVER)
    goal = grasp + level * direction
    near = (aside <= READY) & (axial[..., 0] <= HIGH)
    return at(goal[..., :2], goal[..., 2] + over), near & ~hands.lost[..., i]
