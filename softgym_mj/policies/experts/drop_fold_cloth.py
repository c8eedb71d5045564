"""The expert of DropFoldCloth: lets the cloth down on its far half, which folds it."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.picker_expert import CLOSED, OPEN, PickerExpert

PLACE = 0.75  # Where the cloth falls, as a share of its width: the middle of its far half.
CARRYING, LETTING_DOWN = 0.4, 0.5  # Fractions of full speed.
CLEARANCE = 0.25  # Share of its width by which the cloth is carried higher than it is let go.
RISEN = 1.0  # [m] Height of grippers out of the way.
WAITING = 5  # Env steps for the cloth to come to rest.


class DropFoldCloth(PickerExpert):
    """Carries the cloth over its place and drops it from as low as it can."""

    def _episode(self) -> Iterator[np.ndarray]:
        width = self._env.task.cloth.size[0]
        low = self._actor.limits[0]
        goals = self._actor.positions()
        goals[:, 0] = PLACE * width
        goals[:, 2] = low[2] + CLEARANCE * width
        yield from self._move(goals, CLOSED, CARRYING)
        for _ in range(WAITING):
            yield self._rest(CLOSED)
        yield from self._move(self._raised(low[2]), CLOSED, LETTING_DOWN)
        yield from self._move(self._raised(RISEN), OPEN)
