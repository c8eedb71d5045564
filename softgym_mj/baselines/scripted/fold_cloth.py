"""The expert of FoldCloth: takes the corners of column 0 and swings them over to their mirrors."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.baselines.scripted.cloth_expert import LAYER, TRAVEL_HEIGHT, ClothExpert
from softgym_mj.baselines.scripted.picker_expert import ARRIVED, CLOSED, OPEN, PASSED, SLOW

ARC = 12  # Points of the half circle in which the corners are carried.
SHORT = 0.02  # [m] By which the corners are let down early: the bend takes up as much.


class FoldCloth(ClothExpert):
    """Takes two corners, carries them over in a half circle and lays them down."""

    def _episode(self) -> Iterator[np.ndarray]:
        cloth, grips = self._env.task.cloth, [False, False]
        p1, p2, p3, p4 = cloth.corners.tolist()
        mirror = {p1: p3, p2: p4}
        wanted = self._matched([p1, p2])
        yield from self._take(dict(enumerate(wanted)), grips)
        ends = np.array([cloth.vertex(mirror[v]) for v in wanted])
        ways = ends - [cloth.vertex(v) for v in wanted]
        ends -= SHORT * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        yield from self._swing(ends + [0.0, 0.0, LAYER])
        while True:
            yield self._rest(OPEN)

    def _swing(self, ends: np.ndarray) -> Iterator[np.ndarray]:
        """Carries what both pickers hold to `ends` (2, 3) [m] in half a circle and lets go."""
        start = self._actor.positions()
        ends = ends - (self._target.vertices()[self._actor.held] - start)
        middle, half = (start + ends) / 2, (ends - start) / 2
        for angle in np.linspace(0.0, np.pi, ARC)[1:]:
            goals = middle - np.cos(angle) * half
            goals[:, 2] += np.sin(angle) * np.linalg.norm(half[:, :2], axis=1)
            last = angle == np.pi
            yield from self._move(goals, CLOSED, SLOW, near=ARRIVED if last else PASSED / 2)
        yield self._rest(OPEN)
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN, SLOW)
