"""The expert of RopeConfiguration: puts what lies worst where it belongs, two at a time."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.baselines.scripted.picker_expert import ARRIVED, OPEN, PASSED, PickerExpert

TRAVEL, CARRY = 0.1, 0.07  # [m] Heights of the picker centres, with open grips and holding.
LAID = 0.045  # [m] The same where a vertex is let go.
PUTTING = 0.4  # Fraction of full speed at which vertices are carried.
APART = 6  # Least number of segments between the two vertices.
ROOM = 0.05  # [m] Least distance of the two pickers.
GOOD = 0.01  # [m] Error of a vertex that is left alone.


class RopeConfiguration(PickerExpert):
    """Takes up to two vertices, carries them to their places, and again."""

    def _episode(self) -> Iterator[np.ndarray]:
        while True:
            places = self._chosen()
            if not places:
                yield from self._move(self._raised(TRAVEL), OPEN)
                yield self._rest(OPEN)
                continue
            yield from self._put(places)

    def _goal(self) -> np.ndarray:
        """The letter (41, 3) [m] from the end that suits the rope."""
        goal, vertices = self._env.task.goal, self._target.vertices()
        errors = [np.linalg.norm(vertices - g, axis=1).sum() for g in (goal, goal[::-1])]
        return goal if errors[0] <= errors[1] else goal[::-1]

    def _chosen(self) -> dict[int, np.ndarray]:
        """Up to two vertices that lie wrong, with their places (3,) [m]."""
        goal, vertices = self._goal(), self._target.vertices()
        error = np.linalg.norm(goal - vertices, axis=1)
        chosen: dict[int, np.ndarray] = {}
        for v in np.argsort(-error).tolist():
            if error[v] < GOOD or len(chosen) == 2:
                break
            free = all(
                abs(v - w) >= APART
                and np.linalg.norm(vertices[v] - vertices[w]) > ROOM
                and np.linalg.norm(goal[v] - goal[w]) > ROOM
                for w in chosen
            )
            if free and self._grasp(v)[2] > 0.0:
                chosen[v] = goal[v]
        return chosen

    def _put(self, places: dict[int, np.ndarray]) -> Iterator[np.ndarray]:
        """Takes vertices from above and puts them down at their places."""
        vertices = list(places)
        if len(vertices) == 2:
            wanted = dict(enumerate(self._matched(vertices)))
        else:
            offsets = self._actor.positions() - self._target.vertex(vertices[0])
            wanted = {int(np.argmin(np.linalg.norm(offsets, axis=1))): vertices[0]}
        goals = self._raised(TRAVEL)
        for i, vertex in wanted.items():
            goals[i, :2] = self._grasp(vertex)[0][:2]
        yield from self._move(self._raised(TRAVEL), OPEN, near=PASSED / 2)
        yield from self._move(goals, OPEN, near=PASSED / 5)
        for i, vertex in wanted.items():
            goals[i] = self._grasp(vertex)[0]
        yield from self._move(goals, OPEN)
        grips = [i in wanted for i in range(2)]
        yield self._step(self._actor.positions(), grips)
        goals = self._raised(CARRY)
        for i, vertex in wanted.items():
            goals[i] += (places[vertex] - self._target.vertex(vertex)) * [1.0, 1.0, 0.0]
        yield from self._move(goals, grips, PUTTING, near=PASSED / 5)
        for i in wanted:
            goals[i, 2] = LAID
        yield from self._move(goals, grips, PUTTING, near=ARRIVED)
        yield self._rest(OPEN)
