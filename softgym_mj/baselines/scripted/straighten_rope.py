"""The expert of StraightenRope: takes both ends, pulls them apart, lays the rope down."""

import numpy as np

from softgym_mj.baselines.scripted.picker_expert import CLOSED, OPEN, PASSED, SLOW, PickerExpert
from softgym_mj.entities.rope import LENGTH

# Heights [m] of the picker centres above a rope: passing over, pulling, at the end.
ROPE_APPROACH, ROPE_LIFT, ROPE_LAID = 0.1, 0.1, 0.04
ROPE_TOLERANCE = 0.001  # [m] Error of the end distance at which pulling stops.
ROPE_SPEED = 0.3  # Fraction of full speed at which the rope is pulled.


class StraightenRope(PickerExpert):
    """Takes both ends from above, pulls them apart and lays the rope down."""

    margin = 0.006  # A thinner rope lies lower.

    def _episode(self):
        rope = self._env.task.rope
        ends = self._matched(rope.ends)
        while True:
            yield from self._move(self._raised(ROPE_APPROACH), OPEN, near=PASSED)
            for lift in (ROPE_APPROACH, 0.0):
                goals = np.array([self._grasp(end)[0] for end in ends])
                goals[:, 2] = np.maximum(goals[:, 2], lift)
                yield from self._move(goals, OPEN, SLOW if lift == 0.0 else 1.0)
            yield self._rest(CLOSED)
            if np.all(np.isin(self._actor.held, ends)):
                break
            yield from self._move(self._raised(ROPE_LIFT), CLOSED)  # What covers an end.
        yield from self._move(self._raised(ROPE_LIFT), CLOSED, SLOW)
        centre = np.mean(self._actor.limits, axis=0)
        while abs(error := LENGTH - rope.end_distance()) > ROPE_TOLERANCE:
            line = self._target.vertex(ends[0]) - self._target.vertex(ends[1])
            line *= [1.0, 1.0, 0.0]
            line *= error / 2 / (np.linalg.norm(line) + 1e-9)
            positions = self._actor.positions()
            to_centre = (centre - positions.mean(axis=0)) * [1.0, 1.0, 0.0]
            yield self._step(positions + [line, -line] + to_centre, CLOSED, ROPE_SPEED)
        yield from self._move(self._raised(ROPE_LAID), CLOSED, ROPE_SPEED)
        while True:
            yield self._rest(CLOSED)
