"""`Settling`: a flex alone on the floor, simulated until it is at rest.

The procedures are SoftGym's (facts 3.4 and 3.6) with its settle test made on the speed of every
vertex, where the original compares signed components and so may stop while things fall.
"""

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import Flex
from softgym_mj.robots.base import SIM_STEP

SETTLED_SPEED = 0.01  # [m/s] SoftGym's threshold for ropes and heaps at rest.
MIN_SETTLE_STEPS = 10  # Sim steps: at release the speed passes through zero without being at rest.


class Settling:
    """A flex alone on the floor, stepped by sim steps."""

    def __init__(self, flex: Flex):
        arena = Arena()
        arena.attach(flex)
        self._physics = arena.compile(flex.timestep, flex)
        self._flex = flex
        self._before = flex.points()

    def step(self) -> None:
        """One sim step; divergence is an error."""
        self._before = self._flex.points()
        with self._physics.check_invalid_state():
            mujoco.mj_step(self._physics.model.ptr, self._physics.data.ptr)

    def drag(self, vertex: int, displacement: np.ndarray, steps: int) -> None:
        """Moves a held vertex by `displacement` (3,) [m] in each of `steps` sim steps."""
        goal = self._flex.vertex(vertex)
        for _ in range(steps):
            goal = goal + displacement
            self._flex.drive(vertex, goal, SIM_STEP)
            self.step()

    def settle(self, max_steps: int) -> None:
        """Sim steps until every vertex is slower than `SETTLED_SPEED`, at most `max_steps`."""
        for count in range(1, max_steps + 1):
            self.step()
            if count >= MIN_SETTLE_STEPS and self.max_speed() < SETTLED_SPEED:
                return

    def speeds(self) -> np.ndarray:
        """Mean speed of every vertex (n,) [m/s] in the last sim step.

        The velocity at its end is that of the last substep, which in a heap at rest is some mm/s.
        """
        return np.linalg.norm(self._flex.points() - self._before, axis=1) / SIM_STEP

    def max_speed(self) -> float:
        """Speed of the fastest vertex [m/s]."""
        return float(self.speeds().max())


def centred(vertices: np.ndarray) -> np.ndarray:
    """The vertices (n, 3) shifted so that their horizontal mean is the origin."""
    return vertices - [*vertices[:, :2].mean(axis=0), 0.0]
