"""Reactive expert of RopeConfiguration: carries points of the rope to their places."""

from array_api_compat import device

from softgym_mj.metrics import Array, constant, lengths, namespace, taken
from softgym_mj.policies.reactive.hands import Hands, found_hands, point_at
from softgym_mj.policies.reactive.motions import Motion, actions, at, either, funnel

# Heights of a picker's center [m]: on the way to a point, with a point, and where it is released.
TRAVEL, CARRY, LAID = 0.1, 0.07, 0.045
ABOVE = 0.03  # [m] Height over a point at which it is grasped.
GOOD = 0.02  # [m] Error up to which a point is not moved.
ARRIVED = 0.015  # [m] Distance from its place at which a point is released.
READY = 0.018  # [m] Distance from a grasp along every axis at which a picker closes.
PUTTING = 0.4  # Fraction of full speed at which points are carried.
ROOM = 0.05  # [m] Minimum distance of two points that are moved at once, and of their places.
BESIDE = 2  # Largest difference of the indices of a point and the one nearest to its grasp.
KEEP = 0.075  # [m] Distance of the pickers below which a free one moves away.
NEXT = 5  # Minimum difference of the indices of two points that are moved at once.


def rope_configuration(observation: Array) -> Array:
    """Returns actions (..., 8) of RopeConfiguration for observations "markov" (..., 74).

    Each picker carries a nearby point with a large error to its place, again and again.
    """
    lead, xp = observation.shape[:-1], namespace(observation)
    points = _between(observation[..., :30].reshape((*lead, 10, 3)))
    places = _between(observation[..., 30:60].reshape((*lead, 10, 3)))
    backwards = xp.flip(places, axis=-2)
    errors = [lengths(points - each).sum(-1) for each in (places, backwards)]
    places = xp.where((errors[0] <= errors[1])[..., None, None], places, backwards)
    return carrying(points, places, found_hands(observation[..., 60:], points))


def _between(points: Array) -> Array:
    """Returns points (..., 4 n - 3, 3) on the line through points (..., n, 3)."""
    xp = namespace(points)
    first, last = points[..., :-1, None, :], points[..., 1:, None, :]
    shares = constant([[0.0], [0.25], [0.5], [0.75]], points)
    inner = first + shares * (last - first)
    flat = inner.reshape((*points.shape[:-2], -1, 3))
    return xp.concat([flat, points[..., -1:, :]], axis=-2)


def carrying(points: Array, places: Array, pickers: Hands) -> Array:
    """Returns actions (..., 8) that carry points to their places.

    Args:
        points: (..., n, 3) [m].
        places: (..., n, 3) [m].
        pickers: two pickers.
    """
    targets = _targets(points, places, pickers)
    motions = []
    for i, (target, exists) in enumerate(targets):
        carried = _carried(points, places, pickers, i)
        fetched = _fetched(points, target, exists, pickers, i)
        motions.append(either(pickers.holds[..., i], carried, fetched))
    return actions(pickers.centers, motions)


def _targets(points: Array, places: Array, pickers: Hands) -> list[tuple[Array, Array]]:
    """Returns, for each picker, the index (...) of the point to fetch, and whether there is one."""
    xp = namespace(points)
    index = xp.arange(points.shape[-2], device=device(points))

    def apart(point: Array) -> Array:
        """Returns which points (..., n) can be moved together with one (...)."""
        result = xp.abs(index - point[..., None]) >= NEXT
        for each in (points, places):
            result = result & (_across(each, taken(each, point[..., None])) > ROOM)
        return result

    # A point below another strand cannot be grasped from above.
    offsets = _grasp(points)[..., :, None, :] - points[..., None, :, :]
    nearest = xp.argmin(lengths(offsets), axis=-1)
    error = _across(points, places)
    allowed = (error >= GOOD) & (xp.abs(nearest - index) <= BESIDE)
    for i in range(2):
        allowed = allowed & (apart(pickers.held[..., i]) | ~pickers.holds[..., i, None])
    result: list[tuple[Array, Array]] = []
    for i in range(2):
        # Errors less the picker's way: a picker on its way keeps its target.
        values = error - _across(points, pickers.centers[..., i, None, :])
        point, exists = _largest(values, allowed)
        result.append((point, exists))
        allowed = allowed & (apart(point) | pickers.holds[..., i, None])
    return result


def _carried(points: Array, places: Array, pickers: Hands, i: int) -> Motion:
    """Returns the motion of picker `i` with what it holds: up, to its place, down, release."""
    xp = namespace(points)
    center, height = pickers.centers[..., i, :], pickers.centers[..., i, 2]
    own = pickers.held[..., i]
    place = center + (point_at(places, own) - point_at(points, own))
    there = _across(place, center) <= ARRIVED
    done = there & (height <= LAID + 0.005)
    laid = at(place[..., :2], xp.full_like(height, LAID))
    goal = xp.where(done[..., None], center, funnel(center, laid, CARRY))
    closed = ~done
    if i == 1:  # It gives way to the other one.
        way = pickers.centers[..., 0, :] - center
        blocked = pickers.holds[..., 0] & (lengths(way[..., :2]) < KEEP)
        closed = closed & ~(blocked & (xp.sum((place - center) * way, axis=-1) > 0.0) & ~there)
    return Motion(goal, closed, xp.full_like(height, PUTTING))


def _fetched(points: Array, target: Array, exists: Array, pickers: Hands, i: int) -> Motion:
    """Returns the motion of free picker `i` to a point: over it, down, close; or out of the way."""
    xp = namespace(points)
    center, height = pickers.centers[..., i, :], pickers.centers[..., i, 2]
    other, other_holds = pickers.centers[..., 1 - i, :], pickers.holds[..., 1 - i]
    point = point_at(points, target)
    grasp = _grasp(point)
    between = center - other
    gap = lengths(between[..., :2])
    is_close = gap < KEEP
    exists = exists & (_across(point, other) >= ROOM) & ~(is_close & other_holds)
    closes = exists & ~pickers.lost[..., i] & (xp.max(xp.abs(grasp - center), axis=-1) <= READY)
    # A picker without a target rests; near the other one it moves away.
    away = center + (KEEP / xp.maximum(gap, xp.full_like(gap, 1e-3)))[..., None] * between
    rest = xp.where(is_close[..., None], away, center)[..., :2]
    rest = at(rest, xp.full_like(height, TRAVEL))
    goal = xp.where(closes[..., None], center, funnel(center, grasp, TRAVEL))
    goal = xp.where(exists[..., None], goal, rest)
    return Motion(goal, closes, xp.ones_like(height))


def _grasp(points: Array) -> Array:
    """Returns the positions (..., 3) [m] of pickers that grasp points."""
    return points + constant([0.0, 0.0, ABOVE], points)


def _across(first: Array, second: Array) -> Array:
    """Returns horizontal distances (...) [m] of points (..., 3)."""
    return lengths((first - second)[..., :2])


def _largest(values: Array, allowed: Array) -> tuple[Array, Array]:
    """Returns the index (...) of the largest allowed value (..., n), and whether there is one."""
    xp = namespace(values)
    values = xp.where(allowed, values, -xp.inf)
    return xp.argmax(values, axis=-1), xp.any(allowed, axis=-1)
