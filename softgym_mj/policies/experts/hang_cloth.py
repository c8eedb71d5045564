"""Expert of HangCloth: lays the towel over the bar by the two corners next to it.

The grippers carry these corners over the bar and down, until one half of the towel is beyond it.
"""

from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.cloth_expert import ClothExpert
from softgym_mj.policies.experts.picker_expert import ARRIVED, CLOSED, OPEN, PASSED

ABOVE, BESIDE = 0.07, 0.12  # [m] Distances of held corners from the bar: hands must not touch it.
HALF = 0.5  # Share of the towel beyond the bar at which it is no longer pulled.
TRIALS = 3  # Grasps of the corners.
CARRY, RISE = 0.6, 0.3  # Fractions of full speed over the bar and away from it.
# Fraction of full speed at which corners are lowered, per share of the towel that is still missing,
# and its least value.
LOWER, LEAST = 1.4, 0.07
WAITING = 3  # Env steps for the towel to come to rest.


class HangCloth(ClothExpert):
    """Carries the corners of the last column over the bar."""

    def _episode(self) -> Iterator[np.ndarray]:
        x, height, radius = self._env.task.episode.goal["bar"]
        yield from self._take_end()
        beside = radius + BESIDE
        for away in (-beside, beside):
            goals = self._carried(x + away, height + radius + ABOVE)
            yield from self._move(goals, CLOSED, CARRY, PASSED / 2)
        goals = self._carried(x + beside, 0.0)
        while self._actor.commanded_positions()[:, 2].max() > self._actor.limits[0][2] + ARRIVED:
            left = HALF - self._share_beyond()
            if left <= 0.0 and self._actor.positions()[:, 2].max() < height:
                break
            yield self._step(goals, CLOSED, max(LOWER * left, LEAST))
        for grips in (CLOSED, OPEN):
            for _ in range(WAITING):
                yield self._rest(grips)
        yield from self._move(self._actor.positions() + [BESIDE, 0.0, 0.0], OPEN, RISE)
        yield from self._move(self._raised(height + BESIDE), OPEN, RISE)

    def _take_end(self) -> Iterator[np.ndarray]:
        """Grasps both corners of the last column, again after a failed grasp."""
        grips = [False, False]
        targets = dict(enumerate(self._matched(self._env.task.cloth.corners[2:].tolist())))
        for _ in range(TRIALS):
            left = {i: vertex for i, vertex in targets.items() if not grips[i]}
            if not left:
                return
            yield from self._take(left, grips)

    def _share_beyond(self) -> float:
        """Returns the share of the towel from the column next to the bar to the held end."""
        x, height, _ = self._env.task.episode.goal["bar"]
        columns = self._env.task.cloth.particles().mean(axis=0)
        away = (columns[:, 0] - x) ** 2 + (columns[:, 2] - height) ** 2
        return 1.0 - float(away.argmin()) / (len(away) - 1)

    def _carried(self, x: float, z: float) -> np.ndarray:
        """Returns the gripper centers (2, 3) [m] with the held vertices at X and Z [m]."""
        goals = self._actor.positions()
        offset = goals - self._target.points()[self._actor.held]
        goals[:, 0], goals[:, 2] = x + offset[:, 0], z + offset[:, 2]
        return goals
