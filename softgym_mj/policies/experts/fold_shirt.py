"""Expert of FoldShirt: folds each sleeve in by its cuff, then the hem over by its ends.

Grippers carry what they hold in half circles. Pickers fold a sleeve by both ends of its cuff. Arms
do not reach the cuff on the other side: each folds its own sleeve by the outer end of the cuff,
while the other one keeps aside. Then both fold the hem, again if it springs open.
"""

import math
from collections.abc import Iterator

import numpy as np

from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.cloth_expert import MISPLACED, TRAVEL_HEIGHT, ClothExpert
from softgym_mj.policies.experts.picker_expert import ARRIVED, OPEN, PASSED
from softgym_mj.tasks.fold_shirt import folded, with_sleeves_in

ARC = 8  # Points of a half circle.
# [m] Distance before its place at which a vertex is released, as the bend takes up length, and
# height above the layers below.
SHORT, LANDING = 0.005, 0.01
SPEED = 0.5  # Fraction of full speed.
WAITING = 2  # Env steps for layers to come to rest before and after a release.
TRIALS = 2  # Grasps of a vertex.
LAYERS = 4  # Layers below what is folded over, at least.
# Env steps for which hands close: a UR5e, which stops 3 mm above its lowest point, takes a vertex
# on the floor only after it has come to rest there.
CLOSING = 3


class FoldShirt(ClothExpert):
    """Carries ends of cuffs and of the hem to their places."""

    brakes, closing = True, CLOSING

    def _steps(self, a: int, b: int) -> int:
        spacing = float(np.median(self._target.rest_lengths))
        return round(self._target.mesh_distances.between(a, b) / spacing)

    def _episode(self) -> Iterator[np.ndarray]:
        shape, flat = self._target.arrays, self._env.task.episode.points["shirt"][:, :2]
        keys = shape["keys"].tolist()
        with_sleeves, places = with_sleeves_in(flat, shape), folded(flat, shape)
        if self._has_arms:
            for i, outer in self._pair(keys[2], keys[8]).items():
                yield from self._fold({i: outer}, with_sleeves)
        else:
            for ends in (keys[1:3], keys[8:10]):
                yield from self._fold(self._pair(*ends), with_sleeves)
        hem = self._pair(keys[0], keys[-1])
        yield from self._fold(hem, places)
        away = self._target.points()[:, :2] - places
        opened = {i: vertex for i, vertex in hem.items() if length(away[vertex]) > MISPLACED}
        if self._has_arms and opened:
            yield from self._fold(opened, places)

    def _pair(self, first: int, second: int) -> dict[int, int]:
        """Returns two vertices by the gripper that takes them."""
        return dict(enumerate(self._matched([first, second])))

    def _fold(self, targets: dict[int, int], places: np.ndarray) -> Iterator[np.ndarray]:
        """Carries vertices, `targets` by gripper, to their `places` (n, 2) [m] and releases them.

        Arms take the nearest vertex in reach instead. A vertex that is grasped instead is carried
        to its own place.
        """
        if self._has_arms:
            targets = {i: self._exposed_near([v], i) for i, v in targets.items()}
        grips = [False, False]
        for _ in range(TRIALS):
            left = {i: vertex for i, vertex in targets.items() if not grips[i]}
            if left:
                yield from self._take(left, grips)
        start, goals = self._actor.positions(), self._actor.positions()
        for i in np.flatnonzero(grips):
            held = int(self._actor.held[i])
            at, (x, y) = self._target.vertex(held), places[held]
            way = np.array([x, y, LAYERS * 2.0 * self._target.radius + LANDING]) - at
            goals[i] += way - SHORT * way / math.hypot(*way[:2])
        yield from self._swing(start, goals, grips)
        for grip in (grips, OPEN):
            for _ in range(WAITING):
                yield self._rest(grip)
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN, SPEED)

    def _swing(self, start: np.ndarray, goals: np.ndarray, grips) -> Iterator[np.ndarray]:
        """Moves the grippers from `start` to `goals` (2, 3) [m] in half circles."""
        middle, half = (start + goals) / 2, (goals - start) / 2
        for angle in np.linspace(0.0, np.pi, ARC)[1:]:
            way = middle - math.cos(angle) * half
            way[:, 2] += math.sin(angle) * np.linalg.norm(half[:, :2], axis=1)
            for i in (i for i, grip in enumerate(grips) if not grip):
                way = self._aside(way, i)
            near = ARRIVED if angle == np.pi else PASSED / 2
            yield from self._move(way, grips, SPEED, near)
