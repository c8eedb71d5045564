"""Reactive expert of FoldShirt: swings each cuff over its armhole, then the hem over its fold.

Two pickers hold both ends of a cuff or of the hem and carry them in half circles. The upper body
stays in place: it gives the frame of all motions and the line about which a sleeve turns.
The radius of a sleeve's circle is observed: a taut sleeve's cuff stays on it, and the other sleeve
shows it while it rests. The hem lands at the shoulders, whatever the length of the shirt.
"""

from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.arcs import LAID, SHORT, over, turned
from softgym_mj.policies.reactive.body import (
    ARMPIT,
    FLARE,
    HEM,
    INNER,
    OUTER,
    SHOULDER,
    Frame,
    found_frame,
)
from softgym_mj.policies.reactive.hands import Hands, found_hands
from softgym_mj.policies.reactive.motions import Motion, actions, at, funnel

TRAVEL = 0.25  # [m] Height of pickers on the way.
# [m] Height of a grasp above its key point; horizontal distance from it up to which a picker is
# closed, before the vertex is in reach: imitators never learned to close for a moment only;
# radius of the funnel's bottom, where vertices are in reach; distance of a held vertex from the key
# point that it counts as.
ABOVE, READY, WIDE, SAME = 0.053, 0.035, 0.02, 0.05
SPEED = 0.6  # Limit of the speed of pickers that hold an end, as fraction of full speed.
ARRIVED, LOW = 0.025, 0.012  # [m] Tolerances of a release along every horizontal axis and upwards.
# Distance of the held ends of a cuff and of the hem, as a share of that at rest. A hold that
# stretches the shirt by 10% is lost, which errors of actions do to ends that are as far as at rest.
SLACK, TAUT = 0.8, 0.95
FLOOR = 0.05  # [m] Lowest center of a picker; what it holds at its side gets no lower.
LIFTED = 0.05  # [m] Height from which a vertex is carried on if the other end was lost.
# A cuff counts as out from a distance from its place [m] or a share of its circle's radius on,
# whichever is less, and under a folded hem that much [m] later.
OUT, SHARE, COVERED = 0.08, 0.6, 0.08
EVEN = 0.04  # [m] Difference of the lengths of sleeves at which one alone gives the radius.
FOLDED = 0.07  # [m] Distance of the hem from the shoulders up to which it counts as folded.
# [m] Range of radii of the hem's circle: half of the way to the shoulders; less where the cloth is
# taut before it, as a wider circle would drag the shirt along without end.
FOLDS = 0.1, 0.285


class Part(NamedTuple):
    """Cuff or hem that two pickers fold, in coordinates of `Frame`.

    Attributes:
        grasps: positions of pickers that grasp them (..., 2, 3) [m].
        goals: next positions of the ends on their circles (..., 2, 3) [m].
        landed: whether both held ends are at their places (...).
        holds: whether each picker holds each end (..., 2 pickers, 2 ends).
        count: number of pickers that hold an end (...).
        way: distance of the pickers from the grasps in the better order (...) [m].
        direct: whether picker 0 takes the first end (...).
    """

    grasps: Array
    goals: Array
    landed: Array
    holds: Array
    count: Array
    way: Array
    direct: Array


def fold_shirt(observation: Array) -> Array:
    """Returns actions (..., 8) of FoldShirt for observations "markov" (..., 47)."""
    xp, lead = namespace(observation), observation.shape[:-1]
    keys = observation[..., :33].reshape((*lead, 11, 3))
    hands = found_hands(observation[..., 33:], keys, lowest=0.0)
    frame = found_frame(keys)
    points, centers, places = (frame.local(each) for each in (keys, hands.centers, hands.places))
    sleeves, outs = [], []
    for side in range(2):
        sleeve, out = _sleeve(frame, points, centers, places, hands, side)
        sleeves.append(sleeve)
        outs.append(out)
    hem, folded = _hem(frame, points, centers, places, hands)
    left, right = sleeves
    allowed = COVERED * xp.astype(folded, keys.dtype)
    out_left, out_right = (out > allowed for out in outs)
    busy = left.count + right.count > 0
    takes_hem = (hem.count == 2) | ~(busy | out_left | out_right)
    nearer = out_left & (~out_right | (left.way <= right.way))
    takes_left = (left.count > right.count) | ((left.count == right.count) & nearer)
    part = _select(takes_hem, hem, _select(takes_left, left, right))
    done = takes_hem & folded & (hem.count == 0)
    motions = []
    for i in range(2):
        center = centers[..., i, :]
        goal, closed, carries = _moved(part, centers, places, hands, i)
        rest = at(center[..., :2], xp.full_like(part.way, TRAVEL))
        goal = xp.where(done[..., None], rest, goal)
        full = xp.ones_like(part.way)
        speed = xp.where(carries, SPEED * full, full)
        motions.append(Motion(frame.world(goal), closed & ~done, speed))
    return actions(hands.centers, motions)


def _moved(
    part: Part, centers: Array, places: Array, hands: Hands, i: int
) -> tuple[Array, Array, Array]:
    """Returns the goal (..., 3) [m] of picker `i`, whether it closes and whether it carries."""
    xp, other = namespace(centers), 1 - i
    center, place = centers[..., i, :], places[..., i, :]
    own, others = part.holds[..., i, :], part.holds[..., other, :]
    holds, other_holds = own[..., 0] | own[..., 1], others[..., 0] | others[..., 1]
    lifted, other_lifted = (places[..., k, 2] >= LIFTED for k in (i, other))
    swings = holds & (other_holds | lifted)
    goal = xp.where(own[..., :1], part.goals[..., 0, :], part.goals[..., 1, :])
    # A picker that holds its end alone waits near the floor.
    waits = at(place[..., :2], xp.clip(place[..., 2], None, LAID))
    carried = center + xp.where(swings[..., None], goal, waits) - place
    # A free picker takes the other end.
    first = xp.where(other_holds, others[..., 1], part.direct == (i == 0))
    grasp = xp.where(first[..., None], part.grasps[..., 0, :], part.grasps[..., 1, :])
    closes = lengths((grasp - center)[..., :2]) <= READY
    closes = closes & ~hands.lost[..., i] & ~hands.holds[..., i]
    fetched = funnel(center, grasp, TRAVEL, WIDE)
    # It waits above while the other one carries its end alone.
    alone = other_holds & other_lifted
    above = at(center[..., :2], xp.full_like(part.way, TRAVEL))
    fetched = xp.where(alone[..., None], above, fetched)
    closed = xp.where(holds, ~part.landed, closes & ~alone)
    return xp.where(holds[..., None], carried, fetched), closed, holds


def _sleeve(
    frame: Frame, points: Array, centers: Array, places: Array, hands: Hands, side: int
) -> tuple[Part, Array]:
    """Returns a sleeve, and the distance by which its cuff is out, if positive (...) [m]."""
    xp = namespace(points)
    shapes = []
    for k in (side, 1 - side):
        inner, outer = points[..., INNER[k], :], points[..., OUTER[k], :]
        seams = [inner - points[..., ARMPIT[k], :], outer - points[..., SHOULDER[k], :]]
        reach = lengths(seams[0]) + lengths(seams[1])
        away = [_away(end, frame, k) for end in (inner, outer)]
        radii = [xp.sqrt(n * n + over(n, z) ** 2) for n, z in away]
        shapes.append((reach, radii, [inner[..., 1], outer[..., 1]], away))
    (reach, radii, heights, away), (other_reach, other_radii, other_heights, _) = shapes
    share = xp.clip(0.5 + (reach - other_reach) / (2.0 * EVEN), 0.0, 1.0)
    radii = [share * a + (1.0 - share) * b for a, b in zip(radii, other_radii, strict=True)]
    heights = [share * a + (1.0 - share) * b for a, b in zip(heights, other_heights, strict=True)]
    ends = INNER[side], OUTER[side]
    errors = [
        n + radius - xp.clip(SHARE * radius, None, OUT)
        for (n, _), radius in zip(away, radii, strict=True)
    ]
    out = xp.maximum(*errors)
    radii, heights = _closer(radii), _closer(heights)
    holds = _holds(points, places, hands, ends)
    away = [_away(place, frame, side) for place in _held(points, places, holds, ends)]
    moved = turned(away, radii)
    sign = 1.0 - 2.0 * side
    goals = [
        xp.stack([sign * (frame.chest + n), height, z], axis=-1)
        for (n, z), height in zip(moved, heights, strict=True)
    ]
    finals = [
        xp.stack([sign * (frame.chest - radius + SHORT), height, LAID + 0.0 * height], axis=-1)
        for radius, height in zip(radii, heights, strict=True)
    ]
    return _part(points, centers, places, holds, ends, goals, finals), out


def _hem(
    frame: Frame, points: Array, centers: Array, places: Array, hands: Hands
) -> tuple[Part, Array]:
    """Returns the hem, and whether it is folded over (...)."""
    xp = namespace(points)
    ends = [points[..., end, :] for end in HEM]
    half = TAUT * xp.clip(lengths(ends[0] - ends[1]) / 2, frame.chest, FLARE * frame.chest)
    below = [frame.top - end[..., 1] for end in ends]
    folded = xp.maximum(*below) <= FOLDED
    far = xp.clip((below[0] + below[1]) / 2, 0.01, None)
    height = xp.clip((ends[0][..., 2] + ends[1][..., 2]) / 2 - LAID, 0.0, None)
    holds = _holds(points, places, hands, HEM)
    # The circle through the hem that ends at the shoulders.
    radius = xp.clip((far * far + height * height) / (2.0 * far), *FOLDS)
    away = [
        (frame.top - place[..., 1] - radius, place[..., 2])
        for place in _held(points, places, holds, HEM)
    ]
    moved = turned(away, [radius, radius])
    goals, finals = [], []
    for sign, (n, z) in zip((1.0, -1.0), moved, strict=True):
        goals.append(xp.stack([sign * half, frame.top - radius - n, z], axis=-1))
        finals.append(xp.stack([sign * half, frame.top - SHORT, LAID + 0.0 * half], axis=-1))
    return _part(points, centers, places, holds, HEM, goals, finals), folded


def _part(
    points: Array,
    centers: Array,
    places: Array,
    holds: Array,
    ends: tuple[int, int],
    goals: list[Array],
    finals: list[Array],
) -> Part:
    """Returns a part.

    Args:
        points: key points (..., 11, 3) [m].
        centers, places: of pickers and of what they hold (..., 2, 3) [m].
        holds: as in `Part`.
        ends: indices of its key points.
        goals: next positions of its ends, two of (..., 3) [m].
        finals: positions in which its ends are released, two of (..., 3) [m].
    """
    xp = namespace(points)
    grasps = []
    for k in range(2):
        end = points[..., ends[k], :]
        grasps.append(at(end[..., :2], end[..., 2] + ABOVE))
    ways = [[lengths(centers[..., i, :] - grasp) for grasp in grasps] for i in range(2)]
    direct, crossed = ways[0][0] + ways[1][1], ways[0][1] + ways[1][0]
    landed = True
    for k in range(2):
        for i in range(2):
            off = xp.abs(places[..., i, :] - finals[k])
            there = xp.max(off[..., :2], axis=-1) <= ARRIVED
            low = (places[..., i, 2] <= LAID + LOW) | (centers[..., i, 2] <= FLOOR + LOW)
            there = there & low
            landed = landed & (there | ~holds[..., i, k])
    return Part(
        grasps=xp.stack(grasps, axis=-2),
        goals=xp.stack(goals, axis=-2),
        landed=landed,
        holds=holds,
        count=xp.sum(xp.astype(holds, xp.int64), axis=(-2, -1)),
        way=xp.minimum(direct, crossed),
        direct=direct <= crossed,
    )


def _holds(points: Array, places: Array, hands: Hands, ends: tuple[int, int]) -> Array:
    """Returns whether each picker holds each end (..., 2 pickers, 2 ends)."""
    xp = namespace(points)
    far = [lengths(places - points[..., end : end + 1, :]) for end in ends]
    near = hands.holds & (xp.minimum(*far) <= SAME)
    # Two pickers hold different ends, in the better order.
    direct = far[0][..., 0] + far[1][..., 1] <= far[0][..., 1] + far[1][..., 0]
    ordered = xp.stack([direct, ~direct], axis=-1)
    both = near[..., :1] & near[..., 1:]
    first = xp.where(both, ordered, far[0] <= far[1])
    return xp.stack([near & first, near & ~first], axis=-1)


def _closer(ends: list[Array]) -> list[Array]:
    """Returns coordinates (...) [m] of two ends, closer to each other by the factor `SLACK`."""
    first, second = ends
    return [(a + b + SLACK * (a - b)) / 2 for a, b in ((first, second), (second, first))]


def _held(points: Array, places: Array, holds: Array, ends: tuple[int, int]) -> list[Array]:
    """Returns where ends are held, two points (..., 3) [m]; an end that is not counts as the other.

    Without holds they are the key points.
    """
    xp = namespace(points)
    result = []
    for k in range(2):
        place = points[..., ends[k], :]
        for end in (1 - k, k):
            for i in range(2):
                place = xp.where(holds[..., i, end, None], places[..., i, :], place)
        result.append(place)
    return result


def _away(point: Array, frame: Frame, side: int) -> tuple[Array, Array]:
    """Returns distances (...) [m] of a point (..., 3) outwards from its armhole, and upwards."""
    return (1.0 - 2.0 * side) * point[..., 0] - frame.chest, point[..., 2]


def _select(condition: Array, first: Part, second: Part) -> Part:
    """Returns one of two parts for each entry of a condition (...)."""
    xp = namespace(condition)

    def chosen(a: Array, b: Array) -> Array:
        return xp.where(
            condition.reshape((*condition.shape, *[1] * (a.ndim - condition.ndim))), a, b
        )

    return Part(*(chosen(a, b) for a, b in zip(first, second, strict=True)))
