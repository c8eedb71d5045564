"""Reactive expert of StraightenRope: grasps both ends and pulls them apart.

If the ends are too close together for both hands, one draws its end outwards first. If an arm does
not reach its end, the other one carries the first end to the middle. A hand that holds another
part of the rope lays it aside.
"""

from typing import NamedTuple

from softgym_mj.entities.rope import LENGTH, NUM_KEY_POINTS
from softgym_mj.metrics import Array, constant, lengths, namespace
from softgym_mj.policies.reactive.hands import Hands, cross, found_hands
from softgym_mj.policies.reactive.motions import Motion, actions, at, braked, either, funnel
from softgym_mj.policies.reactive.reach import in_reach


class Manner(NamedTuple):
    """Manner in which pickers or arms straighten a rope.

    Attributes:
        above, ahead: height over an end, and distance beyond it, of a grasp [m].
        room: distance of the ends from which both are grasped [m].
        carry, laid: heights with an end, and once the rope is straight [m].
    """

    above: float
    ahead: float
    room: float
    carry: float
    laid: float


PICKERS = Manner(above=0.03, ahead=0.012, room=0.06, carry=0.08, laid=0.04)
ARMS = Manner(above=0.02, ahead=0.005, room=0.17, carry=0.06, laid=0.03)
TRAVEL = 0.12  # [m] Height of free hands on their way.
READY = 0.012  # [m] Distance from a grasp along every axis at which hands close.
# Largest way of each end in an env step with both held [m]; fraction of full speed with one.
PULLING, CARRYING = 0.02, 0.4
LEVEL, LOWERED = 0.05, 0.2  # [m] Missing distance at full height, and its share when lowered.
SLACK = 0.03  # [m] Largest difference of the distances of the held points and of the ends.
ASIDE = 0.25  # [m] Distance from the middle of an arm that waits.
OUTWARDS = 0.1  # [m] Distance to the goal of a hand that moves outwards.
ACROSS, THERE = 0.06, 0.02  # [m] Place beyond the middle where an arm lays an end; tolerance.
CLEAR = 0.1  # [m] Distance from its end at which a hand releases another part of the rope.


class Ends(NamedTuple):
    """Ends of the rope, each in the place of the hand that takes it.

    Attributes:
        points: (..., 2, 3) [m].
        grasps: positions of hands that grasp them (..., 2, 3) [m].
        held: whether the hands hold them (..., 2).
        reached: whether they are in reach of the hands (..., 2).
    """

    points: Array
    grasps: Array
    held: Array
    reached: Array


def straighten_rope(observation: Array) -> Array:
    """Returns actions (..., 8) of StraightenRope for "markov" (..., 44), of two arms (..., n)."""
    xp, lead = namespace(observation), observation.shape[:-1]
    keys = observation[..., : 3 * NUM_KEY_POINTS].reshape((*lead, NUM_KEY_POINTS, 3))
    hands = found_hands(observation[..., 3 * NUM_KEY_POINTS :], keys, arms=True)
    ends = _ends(hands, keys)
    both, pulled = ends.held[..., 0] & ends.held[..., 1], _pulled(hands, ends)
    motions = []
    for i in range(2):
        held, wrong = ends.held[..., i], hands.holds[..., i] & ~ends.held[..., i]
        motion = either(held, _alone(hands, ends, i), _free(hands, ends, i))
        motion = either(wrong, _wrong(hands, ends, i), motion)
        straight = Motion(pulled[..., i, :], both, xp.ones_like(motion.speed))
        motions.append(either(both, straight, motion))
    return actions(hands.commanded, motions)


def _ends(hands: Hands, keys: Array) -> Ends:
    """Returns the ends of the rope with the key points (..., 10, 3) [m]."""
    xp, manner = namespace(keys), _manner(hands)
    points = xp.stack([keys[..., 0, :], keys[..., -1, :]], axis=-2)
    first, last = (hands.holds & (hands.held == end) for end in (0, NUM_KEY_POINTS - 1))
    holding = first | last
    nearer = points[..., 0, 1] > points[..., 1, 1] if hands.are_arms else cross(hands, points)
    swapped = xp.where(holding[..., 1], first[..., 1], nearer)
    swapped = xp.where(holding[..., 0], last[..., 0], swapped)
    reached = _reached(hands, _ordered(points, swapped))
    # An arm that has to bring an end into reach of the other one takes that arm's.
    brings = ~(holding[..., 0] | holding[..., 1]) & ~(reached[..., 0] & reached[..., 1])
    swapped, reached = swapped ^ brings, reached & ~brings[..., None]
    away = points - xp.stack([keys[..., 1, :], keys[..., -2, :]], axis=-2)
    away = away[..., :2] / xp.clip(lengths(away[..., :2]), 1e-6, None)[..., None]
    grasps = at(points[..., :2] + manner.ahead * away, points[..., 2] + manner.above)
    held = [
        xp.where(swapped, *each)
        for each in ((last[..., 0], first[..., 0]), (first[..., 1], last[..., 1]))
    ]
    return Ends(
        _ordered(points, swapped), _ordered(grasps, swapped), xp.stack(held, axis=-1), reached
    )


def _manner(hands: Hands) -> Manner:
    return ARMS if hands.are_arms else PICKERS


def _ordered(points: Array, swapped: Array) -> Array:
    """Returns two points (..., 2, 3), in reverse order where swapped (...)."""
    xp = namespace(points)
    return xp.where(swapped[..., None, None], xp.flip(points, axis=-2), points)


def _reached(hands: Hands, points: Array) -> Array:
    """Returns whether each hand reaches its point (..., 2)."""
    xp = namespace(points)
    reached = [in_reach(i, points[..., i, :]) for i in range(2)]
    return xp.stack(reached, axis=-1) | (not hands.are_arms)


def _outwards(hands: Hands, i: int) -> Array:
    """Returns the horizontal unit vector (..., 2) along which hand `i` leaves the middle."""
    xp, center = namespace(hands.centers), hands.centers[..., i, :2]
    if hands.are_arms:
        return xp.zeros_like(center) + constant([0.0, 2.0 * i - 1.0], center)
    return center / xp.clip(lengths(center), 1e-3, None)[..., None]


def _is_apart(hands: Hands, ends: Ends, i: int) -> Array:
    """Returns whether hand `i` has room (...) to grasp its end beside the other hand."""
    away = hands.centers[..., 1 - i, :] - ends.points[..., i, :]
    return lengths(away[..., :2]) >= _manner(hands).room


def _keeps(hands: Hands, ends: Ends, i: int) -> Array:
    """Returns whether hand `i` keeps an end (...), as the other one reaches its own before it."""
    xp = namespace(ends.points)
    if not hands.are_arms:
        return xp.ones_like(hands.holds[..., i])
    away = hands.centers[..., i, :2] - ends.points[..., 1 - i, :2]
    return ends.reached[..., 1 - i] & (xp.sum(away * _outwards(hands, i), axis=-1) > 0.0)


def _alone(hands: Hands, ends: Ends, i: int) -> Motion:
    """Returns the motion of hand `i`, which holds an end: it makes room for the other hand.

    An arm that does not keep it lays it down beyond the middle, for the other arm.
    """
    xp, center, manner = namespace(ends.points), hands.centers[..., i, :], _manner(hands)
    full, outwards = xp.ones_like(center[..., 0]), _outwards(hands, i)
    aside = at(center[..., :2] + OUTWARDS * outwards, manner.carry * full)
    apart = _is_apart(hands, ends, 1 - i)[..., None]
    goal = xp.where(apart, hands.commanded[..., i, :], aside)
    place = -ACROSS * outwards
    there = lengths(place - center[..., :2]) < THERE
    down = at(place, xp.where(there, manner.laid * full, manner.carry * full))
    keeps = _keeps(hands, ends, i)
    closed = keeps | ~there | (center[..., 2] > manner.laid + THERE / 2)
    return Motion(xp.where(keeps[..., None], goal, down), closed, CARRYING * full)


def _wrong(hands: Hands, ends: Ends, i: int) -> Motion:
    """Returns the motion of hand `i`, which holds another part: outwards, then it releases it."""
    xp, center = namespace(ends.points), hands.centers[..., i, :]
    full, outwards = xp.ones_like(center[..., 0]), _outwards(hands, i)
    clear = lengths((center - ends.points[..., i, :])[..., :2]) > CLEAR
    clear = clear | (xp.sum(outwards * center[..., :2], axis=-1) > ASIDE)
    goal = at(center[..., :2] + OUTWARDS * outwards, _manner(hands).carry * full)
    return Motion(goal, ~clear, CARRYING * full)


def _free(hands: Hands, ends: Ends, i: int) -> Motion:
    """Returns the motion of free hand `i`: to its end, or out of the way."""
    xp, points, other = namespace(ends.points), ends.points, ends.held[..., 1 - i]
    center, commanded = hands.centers[..., i, :], hands.commanded[..., i, :]
    full = xp.ones_like(center[..., 0])
    gap = lengths((points[..., 0, :] - points[..., 1, :])[..., :2])
    together = (gap >= _manner(hands).room) & ends.reached[..., 0] & ends.reached[..., 1]
    rest = commanded[..., :2]
    is_first = full * (1 - i) > 0.0
    if hands.are_arms:  # That of the side on which the ends are draws one of them.
        is_first = (points[..., 0, 1] + points[..., 1, 1]) * (2 * i - 1) > 0.0
        rest = xp.stack([commanded[..., 0], ASIDE * (2 * i - 1) * full], axis=-1)
    second = _keeps(hands, ends, 1 - i) & _is_apart(hands, ends, i)
    fetches = xp.where(other, second, together | is_first)
    grasp = ends.grasps[..., i, :]
    near = xp.max(xp.abs(grasp - center), axis=-1) <= READY
    goal = xp.where(fetches[..., None], funnel(center, grasp, TRAVEL), at(rest, TRAVEL * full))
    speed = braked(commanded, goal) if hands.are_arms else full
    return Motion(goal, fetches & near & ~hands.lost[..., i], speed)


def _pulled(hands: Hands, ends: Ends) -> Array:
    """Returns the goals (..., 2, 3) [m] of hands that hold both ends.

    These move apart to the length of the rope about the middle, each arm to its own side.
    """
    xp, commanded, manner = namespace(ends.points), hands.commanded, _manner(hands)
    places = commanded + hands.places - hands.centers
    across = places[..., 1, :2] - places[..., 0, :2]
    distance = lengths(ends.points[..., 1, :] - ends.points[..., 0, :])
    held = lengths(hands.places[..., 1, :] - hands.places[..., 0, :])
    length = (LENGTH + xp.clip(held - distance, -SLACK, SLACK))[..., None]
    line = across / xp.clip(lengths(across), 1e-3, None)[..., None]
    line = _outwards(hands, 1) if hands.are_arms else line
    change = length * line - across
    size = xp.clip(lengths(change), 1e-6, None)[..., None]
    change = change * xp.clip(2.0 * PULLING / size, None, 1.0)
    moved = xp.clip(-xp.mean(places[..., :2], axis=-2), -PULLING, PULLING)
    share = xp.clip((LENGTH - distance) / LEVEL - LOWERED, 0.0, 1.0)
    height = manner.laid + (manner.carry - manner.laid) * share
    rise = xp.clip(height[..., None] - commanded[..., 2], -PULLING, PULLING)
    goals = [commanded[..., i, :2] + moved + (i - 0.5) * change for i in range(2)]
    return at(xp.stack(goals, axis=-2), commanded[..., 2] + rise)
