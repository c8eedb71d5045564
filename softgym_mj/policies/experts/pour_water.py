"""Expert of PourWater: tilts the cup about its lip, above the target.

The lip is the outer upper edge on the target's side. The upright or tilted cup is always behind it,
so that it does not touch the target.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from softgym_mj.entities.cup import CupSize
from softgym_mj.policies.experts.expert import Expert, smooth

STANDOFF = 0.01  # [m] Distance between the lip and the target during the approach.
REACH = 0.02  # [m] Distance of the lip inside the target's near wall while pouring.
CLEARANCE = 0.015  # [m] Minimum distance of the cup to the target's rim below it.
ACCELERATION = 0.8  # [m/s^2] Acceleration of the approach: the water slopes by 5 degrees.
TRAVEL_TILT = 0.35  # [rad] Margin to the spill angle during the approach,
READY_TILT = 0.08  # [rad] and when the lip moves over the target.
SHORTEST, TILT, FORWARD, DRAIN = 0.8, 0.5, 0.5, 0.6  # [s] Minimum of the approach; other phases.
LEFT_OVER = 1.0  # [s] Time for the last drops.
DRAINED = math.radians(115.0)  # Angle at which the cup is empty.

Path = Iterator[tuple[float, float, float]]  # The lip's x, z [m] and the angle [rad].


def spill_angle(size: CupSize, held: float) -> float:
    """Returns the angle [rad] of a cup at rest with `held` [m^2] of water in its x-z section.

    The surface passes through the inner upper edge; the section of the water is a triangle, or the
    cup's section minus a triangle.
    """
    length, depth = size.length, size.depth
    if held >= length * depth / 2:
        return math.atan(2 * (depth - held / length) / length)
    return math.atan2(depth**2, 2 * held)


class PourWater(Expert):
    """Approaches, tilts to just below the spill angle, then pours at a constant rate."""

    def _episode(self) -> Iterator[np.ndarray]:
        for lip in self._path():
            yield self._step(self._floor(*lip))

    def _step(self, goal: np.ndarray) -> np.ndarray:
        """Returns the action that moves the cup straight to a pose, within the limits."""
        actor = self._env.task.actor
        action = (goal - actor.commanded_pose) / (actor.max_step * self._env.task.action_repeat)
        return action / max(np.abs(action).max(), 1.0)

    def _floor(self, x: float, z: float, theta: float) -> np.ndarray:
        """Returns the pose of the cup at an angle [rad] whose lip is at (x, z) [m]."""
        size = self._env.task.cup.size
        along, up = size.length / 2 + size.wall, size.height
        cosine, sine = math.cos(theta), math.sin(theta)
        return np.array([x - along * cosine - up * sine, z + along * sine - up * cosine, theta])

    def _volume(self) -> float:
        """Returns the volume of the water [m^3]."""
        return self._env.task.start.variation(self._env.task.variation).volume

    def _path(self) -> Path:
        """Returns the lip's x, z [m] and the angle [rad] after each env step."""
        task, step = self._env.task, self._env.control_timestep()
        size, target = task.cup.size, task.target.size
        near = task.target.pose[0] - target.length / 2 - target.wall  # Outer face of its near wall.
        over = near + target.wall + REACH
        held = self._volume() / size.width
        flows = spill_angle(size, held)
        travel, ready = max(flows - TRAVEL_TILT, 0.0), max(flows - READY_TILT, 0.0)

        def height(theta: float) -> float:
            """Returns the height of the lip at which the sloping wall of the cup has clearance."""
            return target.height + CLEARANCE + (over - near) / math.tan(theta)

        start = size.length / 2 + size.wall, size.height
        top = height(ready)
        way = math.hypot(near - STANDOFF - start[0], top - start[1])
        duration = max(SHORTEST, math.sqrt(5.77 * way / ACCELERATION), travel * 1.875)
        for s in map(smooth, phase(duration, step)):
            yield (
                start[0] + s * (near - STANDOFF - start[0]),
                start[1] + s * (top - start[1]),
                s * travel,
            )
        for s in map(smooth, phase(TILT, step)):
            yield near - STANDOFF, top, travel + s * (ready - travel)
        for s in map(smooth, phase(FORWARD, step)):
            yield near - STANDOFF + s * (over - near + STANDOFF), top, ready
        yield from self._pour(over, height, ready, duration + TILT + FORWARD)

    def _pour(self, x: float, height: Callable[[float], float], theta: float, used: float) -> Path:
        """Tilts the cup from an angle [rad] at constant flow, the lip at x [m] and `height(angle)`.

        `used` [s] have passed; the rest leaves time for the last drops.
        """
        task, step = self._env.task, self._env.control_timestep()
        size, held = task.cup.size, self._volume() / task.cup.size.width
        left = self._env.horizon * step - used - DRAIN - LEFT_OVER
        for s in phase(max(left, 1.0), step):
            angle = max(theta, spill_angle(size, (1.0 - s) * held))
            yield x, height(angle), angle
        for s in map(smooth, phase(DRAIN, step)):
            yield x, height(math.pi / 2), math.pi / 2 + s * (DRAINED - math.pi / 2)


def phase(duration: float, step: float) -> np.ndarray:
    """Returns the fractions (n,) of a duration [s] at the ends of its env steps [s]."""
    count = round(duration / step)
    return (np.arange(count) + 1) / count
