"""The expert of PourWater: tip the cup about its lip, held over the target.

The lip is the outer upper edge on the target's side: wherever it is, the upright or tipped cup
lies behind it, so that it can come near the target without touching it.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from softgym_mj.entities.cup import CupSize
from softgym_mj.policies.experts.expert import Expert, smooth

STANDOFF = 0.01  # [m] Between the lip and the target while the cup approaches.
REACH = 0.02  # [m] By which the lip is inside the target's near wall while it pours.
CLEARANCE = 0.015  # [m] Least distance of the cup to the target's rim below it.
ACCELERATION = 0.8  # [m/s^2] On the way: the water then slopes by 5 degrees.
TRAVEL_TILT = 0.35  # [rad] Short of flowing over the lip on the way,
READY_TILT = 0.08  # [rad] and when the lip moves over the target.
SHORTEST, TILT, FORWARD, DRAIN = 0.8, 0.5, 0.5, 0.6  # [s] Least duration on the way; other phases.
LEFT_OVER = 1.0  # [s] For the last drops.
DRAINED = math.radians(115.0)  # Angle at which nothing stays in the cup.

Path = Iterator[tuple[float, float, float]]  # The lip's x, z [m] and the angle [rad].


def spill_angle(size: CupSize, held: float) -> float:
    """Angle [rad] at which a cup at rest holds `held` [m^2] of water in its x-z section.

    The surface passes through the inner upper edge: above the diagonal of the section it cuts off
    a triangle, below it is one.
    """
    length, depth = size.length, size.depth
    if held >= length * depth / 2:
        return math.atan(2 * (depth - held / length) / length)
    return math.atan2(depth**2, 2 * held)


class PourWater(Expert):
    """Approaches, tips to just before the water flows, then pours it out at an even rate."""

    def _episode(self) -> Iterator[np.ndarray]:
        for lip in self._path():
            yield self._step(self._floor(*lip))

    def _step(self, goal: np.ndarray) -> np.ndarray:
        """The action that moves the cup straight to a pose, or as near as it can."""
        actor = self._env.task.actor
        action = (goal - actor.commanded_pose) / (actor.max_step * self._env.task.action_repeat)
        return action / max(np.abs(action).max(), 1.0)

    def _floor(self, x: float, z: float, theta: float) -> np.ndarray:
        """The cup's pose that puts its lip at (x, z) [m] with the cup at an angle [rad]."""
        size = self._env.task.cup.size
        along, up = size.length / 2 + size.wall, size.height
        cosine, sine = math.cos(theta), math.sin(theta)
        return np.array([x - along * cosine - up * sine, z + along * sine - up * cosine, theta])

    def _volume(self) -> float:
        """Of the water [m^3]."""
        return self._env.task.start.variation(self._env.task.variation).volume

    def _path(self) -> Path:
        """The lip's x, z [m] and the angle [rad] after each env step."""
        task, step = self._env.task, self._env.control_timestep()
        size, target = task.cup.size, task.target.size
        near = task.target.pose[0] - target.length / 2 - target.wall  # Outer face of its near wall.
        over = near + target.wall + REACH
        held = self._volume() / size.width
        flows = spill_angle(size, held)
        travel, ready = max(flows - TRAVEL_TILT, 0.0), max(flows - READY_TILT, 0.0)

        def height(theta: float) -> float:
            """Where the lip must be for the cup's wall, which slopes down from it, to clear."""
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
        """Tips the cup from an angle [rad], the lip at x [m] and `height` of the angle.

        Equal volumes leave in equal times; the last drops have time to fall. `used` [s] are gone.
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
    """Fractions (n,) of a duration [s] at the ends of its env steps [s]."""
    count = round(duration / step)
    return (np.arange(count) + 1) / count
