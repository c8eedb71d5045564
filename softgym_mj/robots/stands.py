"""`Stand`: where an arm is mounted and how far it reaches."""

import dataclasses
import math

import numpy as np

MIDDLE = 0.15  # [m] Height over the base at which an arm with its tool down reaches furthest.
FORWARD = 0.05  # [m] Least distance of the tool in front of the base's axis.


@dataclasses.dataclass(frozen=True)
class Stand:
    """An arm's place.

    Attributes:
        base: middle of the mounting plane (3,) [m].
        yaw: direction that the arm faces, from +X towards +Y [rad].
        inner: least distance of the tool from the base's axis [m]; it also stays in front.
        outer: largest distance from the point of this axis that is `MIDDLE` above the base [m].
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
        rise = point[2] - self.base[2] - MIDDLE
        outer = math.sqrt(max(self.outer**2 - rise**2, self.inner**2))
        scale = min(max(distance, self.inner), outer) / distance
        forward, left = scale * forward, scale * left
        x, y = cos * forward - sin * left, sin * forward + cos * left
        return np.array([self.base[0] + x, self.base[1] + y, point[2]])


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
