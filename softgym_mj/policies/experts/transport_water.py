"""Expert of TransportWater: a minimum-jerk motion to the goal."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.expert import Expert, smooth
from softgym_mj.tasks.transport_water import GOAL

# [s] Duration of the motion: at most 0.75 m/s and 0.77 m/s^2, a slope of the water of 4.5
# degrees.
DURATION = 3.0


class TransportWater(Expert):
    """Follows a minimum-jerk profile to the goal, then rests."""

    def _episode(self) -> Iterator[np.ndarray]:
        actor, step = self._env.task.actor, self._env.control_timestep()
        stride = actor.max_step[0] * self._env.task.action_repeat
        start, time = actor.commanded_pose[0], 0.0
        while time < DURATION:
            time += step
            goal = start + (GOAL - start) * smooth(time / DURATION)
            yield np.clip([(goal - actor.commanded_pose[0]) / stride], -1.0, 1.0)
