"""`Hands`: state of two pickers or arms, for reactive experts."""

import math
from typing import NamedTuple

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array, lengths, namespace, taken

PICKERS = 14  # Numbers of two pickers; arms have more.


class Hands(NamedTuple):
    """Two pickers, or the hands of two arms.

    Attributes:
        centers: (..., 2, 3) [m].
        holds: whether each holds a point (..., 2).
        lost: whether each must open before it can take a point (..., 2).
        held: index of the point that it holds, or of the nearest one (..., 2).
        places: of held points (..., 2, 3) [m].
        commanded: centers that actions displace (..., 2, 3) [m]; those of arms run ahead.
        are_arms: whether they belong to arms.
    """

    centers: Array
    holds: Array
    lost: Array
    held: Array
    places: Array
    commanded: Array
    are_arms: bool


def found_hands(
    numbers: Array, points: Array, lowest: float = -math.inf, *, arms: bool = False
) -> Hands:
    """Returns the pickers or arms at the end of an observation "markov".

    Args:
        numbers: centers and grips (..., 14); of arms centers, other senses, grips and commanded
            centers.
        points: points that they can hold (..., n, 3) [m].
        lowest: smallest height of a held point [m].
        arms: whether the expert is made for arms, too.

    Raises:
        InvalidArgumentError: for arms and an expert that is not made for them.
    """
    xp, lead = namespace(numbers), numbers.shape[:-1]
    are_arms = numbers.shape[-1] > PICKERS
    if are_arms and not arms:
        raise InvalidArgumentError("actor", "an arm", "'picker', as this expert does not move arms")
    centers = numbers[..., :6].reshape((*lead, 2, 3))
    commanded = numbers[..., -6:].reshape((*lead, 2, 3)) if are_arms else centers
    grips = (numbers[..., -14:-6] if are_arms else numbers[..., 6:]).reshape((*lead, 2, 4))
    places = centers + grips[..., 1:]
    places = xp.concat([places[..., :2], xp.clip(places[..., 2:], lowest, None)], axis=-1)
    held = xp.argmin(lengths(points[..., None, :, :] - places[..., :, None, :]), axis=-1)
    holds, lost = grips[..., 0] > 0.5, grips[..., 0] < -0.5
    return Hands(centers, holds, lost, held, places, commanded, are_arms)


def cross(hands: Hands, points: Array) -> Array:
    """Returns whether both hands are nearer, from above, to the other one of two points (...).

    Args:
        hands: both hands.
        points: (..., 2, 3) [m].
    """
    ways = lengths((hands.centers[..., :, None, :] - points[..., None, :, :])[..., :2])
    return ways[..., 0, 1] + ways[..., 1, 0] < ways[..., 0, 0] + ways[..., 1, 1]


def point_at(points: Array, index: Array) -> Array:
    """Returns a point (..., 3) out of points (..., n, 3) by its index (...)."""
    return taken(points, index[..., None])[..., 0, :]
