"""The expert of RopeConfiguration: puts what lies worst where it belongs, two at a time."""

from collections.abc import Iterator

import numpy as np

from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.picker_expert import ARRIVED, OPEN, PASSED, PickerExpert

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
            if places := self._chosen():
                yield from self._put(places)
            else:
                yield from self._move(self._raised(TRAVEL), OPEN)
                yield self._rest(OPEN)

    def _goal(self) -> np.ndarray:
        """The letter (41, 3) [m] from the end that suits the rope."""
        goal, vertices = self._env.task.episode.goal["rope"], self._target.points()
        errors = [np.linalg.norm(vertices - g, axis=1).sum() for g in (goal, goal[::-1])]
        return goal if errors[0] <= errors[1] else goal[::-1]

    def _chosen(self) -> dict[int, tuple[int, np.ndarray]]:
        """By gripper, up to two vertices that lie wrong and where they belong (3,) [m]."""
        goal, vertices = self._goal(), self._target.points()
        error = np.linalg.norm(goal - vertices, axis=1)
        room = max(ROOM, self._actor.least_distance)
        chosen: list[int] = []
        for v in np.argsort(-error, kind="stable").tolist():
            if error[v] < GOOD or len(chosen) == 2:
                break
            free = all(
                abs(v - w) >= APART
                and length(vertices[v] - vertices[w]) > room
                and length(goal[v] - goal[w]) > room
                for w in chosen
            )
            if free and self._grasp(v)[2] > 0.0 and self._takers([*chosen, v], goal):
                chosen.append(v)
        return {i: (v, goal[v]) for i, v in self._takers(chosen, goal).items()}

    def _takers(self, vertices: list[int], goal: np.ndarray) -> dict[int, int]:
        """Which gripper can carry which vertex to where it belongs in `goal` (41, 3) [m].

        Nothing if they cannot carry all of them.
        """
        able = [[v for v in vertices if self._can_carry(i, v, goal[v])] for i in range(2)]
        if len(vertices) == 2:
            matched = self._matched(vertices)
            crossing = self._actor.order(goal[matched]) != [0, 1]
            if crossing or any(v not in able[i] for i, v in enumerate(matched)):
                return {}
            return dict(enumerate(matched))
        for vertex in vertices:
            offsets = np.linalg.norm(self._actor.positions() - self._target.vertex(vertex), axis=1)
            for i in np.argsort(offsets, kind="stable").tolist():
                if vertex in able[i]:
                    return {i: vertex}
        return {}

    def _can_carry(self, i: int, vertex: int, place: np.ndarray) -> bool:
        """Whether gripper `i` reaches both a vertex and where it belongs (3,) [m]."""
        above = place * [1.0, 1.0, 0.0] + [0.0, 0.0, LAID]
        return self._can_reach(i, vertex) and np.allclose(self._actor.within_reach(i, above), above)

    def _put(self, places: dict[int, tuple[int, np.ndarray]]) -> Iterator[np.ndarray]:
        """Takes vertices from above and puts them down at their places."""
        goals = self._raised(TRAVEL)
        for i, (vertex, _) in places.items():
            goals[i, :2] = self._grasp(vertex)[0][:2]
        idle = [i for i in range(2) if i not in places]
        for i in idle:
            goals = self._aside(goals, i)
        yield from self._move(self._raised(TRAVEL), OPEN, near=PASSED / 2)
        yield from self._move(goals, OPEN, near=PASSED / 5)
        for i, (vertex, _) in places.items():
            goals[i] = self._grasp(vertex)[0]
        yield from self._move(goals, OPEN)
        grips = [i in places for i in range(2)]
        yield self._step(self._actor.positions(), grips)
        goals = self._raised(CARRY)
        for i, (vertex, place) in places.items():
            goals[i] += (place - self._target.vertex(vertex)) * [1.0, 1.0, 0.0]
        for i in idle:
            goals = self._aside(goals, i)
        yield from self._move(goals, grips, PUTTING, near=PASSED / 5)
        for i in places:
            goals[i, 2] = LAID
        yield from self._move(goals, grips, PUTTING, near=ARRIVED)
        yield self._rest(OPEN)
