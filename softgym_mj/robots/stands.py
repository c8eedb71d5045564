"""`Stand`: where an arm is mounted, how far it reaches, and how two arms keep apart."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

# [m] What two arms keep between their centre lines in plan view: two forearms (radius 6 cm each in
# the models) and the few centimetres by which the arms lag behind their commands.
CLEARANCE = 0.16
HAND = 0.07  # [m] By which the hand sticks out to both sides of the tool point.
FORWARD = 0.05  # [m] Least distance of the tool in front of the base's axis.

Point = Sequence[float]


@dataclasses.dataclass(frozen=True)
class Stand:
    """An arm's place.

    Attributes:
        base: middle of the mounting plane (3,) [m].
        yaw: direction that the arm faces, from +X towards +Y [rad].
        inner, outer: the tool stays between these distances from the base's axis [m], in front.
    """

    base: tuple[float, float, float]
    yaw: float
    inner: float
    outer: float

    def clip(self, point: np.ndarray) -> np.ndarray:
        """The point (3,) [m] within reach that an arm goes to for `point` (3,)."""
        sin, cos = math.sin(self.yaw), math.cos(self.yaw)
        dx, dy = point[0] - self.base[0], point[1] - self.base[1]
        forward, left = max(cos * dx + sin * dy, FORWARD), cos * dy - sin * dx
        distance = math.hypot(forward, left)
        scale = min(max(distance, self.inner), self.outer) / distance
        forward, left = scale * forward, scale * left
        x, y = cos * forward - sin * left, sin * forward + cos * left
        return np.array([self.base[0] + x, self.base[1] + y, point[2]])

    def lines(self, point: np.ndarray) -> tuple[tuple[Point, Point], ...]:
        """Plan view of the arm with its tool at `point` (3,) [m]: arm and hand as segments."""
        across, along = HAND * math.sin(self.yaw), HAND * math.cos(self.yaw)
        x, y = float(point[0]), float(point[1])
        return (
            (self.base[:2], (x, y)),
            ((x - across, y + along), (x + across, y - along)),
        )


def facing_each_other(
    number: int, distance: float, inner: float, outer: float, height: float = 0.0
) -> tuple[Stand, ...]:
    """One stand at -Y that faces +Y and, for two, another one opposite.

    Args:
        number: 1 or 2.
        distance: of the bases from the origin [m].
        inner, outer: as in `Stand`.
        height: of the mounting planes [m].
    """
    stands = (
        Stand((0.0, -distance, height), math.pi / 2, inner, outer),
        Stand((0.0, distance, height), -math.pi / 2, inner, outer),
    )
    return stands[:number]


def separation(stands: Sequence[Stand], points: np.ndarray) -> float:
    """Distance [m] between two arms in plan view with their tools at `points` (2, 3) [m]."""
    first, second = (stand.lines(point) for stand, point in zip(stands, points, strict=True))
    return min(segment_distance(*a, *b) for a in first for b in second)


def segment_distance(a: Point, b: Point, c: Point, d: Point) -> float:
    """Distance between the segments a b and c d in the plane."""
    if _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0:
        return 0.0
    return min(
        _point_distance(a, c, d),
        _point_distance(b, c, d),
        _point_distance(c, a, b),
        _point_distance(d, a, b),
    )


def _side(a: Point, b: Point, p: Point) -> float:
    """Positive where p is to the left of the line from a to b."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _point_distance(p: Point, a: Point, b: Point) -> float:
    """Distance of p from the segment a b."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = (p[0] - a[0]) * dx + (p[1] - a[1]) * dy
    fraction = min(max(along / (dx * dx + dy * dy), 0.0), 1.0)
    return math.hypot(p[0] - a[0] - fraction * dx, p[1] - a[1] - fraction * dy)
