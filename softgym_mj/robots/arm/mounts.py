"""`Mount`: base and reach of an arm."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

# [m] Height over the base at which the reach of an arm with its tool down is largest.
MIDDLE = 0.15
FORWARD = 0.05  # [m] Least distance of the tool in front of the base's axis.
END = 1e-4  # [m] Tolerance of the end of the reach.


@dataclasses.dataclass(frozen=True)
class Mount:
    """Base and reach of an arm.

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
        """Returns the nearest allowed point (3,) [m] within reach for `point` (3,)."""
        sin, cos = math.sin(self.yaw), math.cos(self.yaw)
        forward, left = self._seen(point)
        forward = max(forward, FORWARD)
        distance = math.hypot(forward, left)
        scale = min(max(distance, self.inner), self.farthest(point[2])) / distance
        forward, left = scale * forward, scale * left
        x, y = cos * forward - sin * left, sin * forward + cos * left
        return np.array([self.base[0] + x, self.base[1] + y, point[2]])

    def farthest(self, height: float) -> float:
        """Returns the largest distance [m] from the base's axis at a height [m] above the floor."""
        rise = height - self.base[2] - MIDDLE
        return math.sqrt(max(self.outer**2 - rise**2, self.inner**2))

    def at_end(self, point: np.ndarray) -> bool:
        """Returns whether a point (3,) [m] is at the end of the reach or beyond it."""
        forward, left = self._seen(point)
        distance = math.hypot(forward, left)
        near = forward < FORWARD + END or distance < self.inner + END
        return near or distance > self.farthest(point[2]) - END

    def _seen(self, point: np.ndarray) -> tuple[float, float]:
        """Returns the coordinates [m] of a point (3,) [m] in front of the base and to its left."""
        sin, cos = math.sin(self.yaw), math.cos(self.yaw)
        dx, dy = point[0] - self.base[0], point[1] - self.base[1]
        return cos * dx + sin * dy, cos * dy - sin * dx


def facing_each_other(
    number: int, distance: float, inner: float, outer: float, height: float = 0.0
) -> tuple[Mount, ...]:
    """Returns one mount at -Y that faces +Y and, for two, another one opposite.

    Args:
        number: 1 or 2.
        distance: distance of the bases from the origin [m].
        inner, outer: as in `Mount`.
        height: height of the mounting planes [m].
    """
    mounts = (
        Mount((0.0, -distance, height), math.pi / 2, inner, outer),
        Mount((0.0, distance, height), -math.pi / 2, inner, outer),
    )
    return mounts[:number]


def exchanged(mounts: Sequence[Mount], turn: np.ndarray) -> list[int] | None:
    """Returns for each mount which one becomes it if the world is turned; None if not all do.

    Args:
        mounts: mounts of arms of a kind.
        turn: matrix (3, 3) that transforms positions in the world.
    """
    if np.linalg.det(turn) < 0.0:  # No arm is its own mirror image.
        return None

    def placed(mount: Mount) -> np.ndarray:
        return np.array([mount.base, (math.cos(mount.yaw), math.sin(mount.yaw), 0.0)])

    places = [placed(mount) for mount in mounts]
    order = []
    for place in places:
        same = [np.allclose(place, other @ turn.T, atol=1e-9) for other in places]
        if not any(same):
            return None
        order.append(same.index(True))
    return order
