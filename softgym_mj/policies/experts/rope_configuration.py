"""Expert of RopeConfiguration: moves the most misplaced vertices to their places, two at a time."""

import functools
import itertools
import math
from collections.abc import Iterator

import numpy as np

from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.picker_expert import ARRIVED, OPEN, PASSED
from softgym_mj.policies.experts.rehearsing import GAIN, Plan, RehearsingExpert

TRAVEL, CARRY = 0.1, 0.07  # [m] Heights of the picker centers, with open grips and holding.
LAID = 0.045  # [m] Height of the picker centers where a vertex is released.
# [m] Heights of hands above their lowest position: they hold vertices in the tool point itself.
ARM_TRAVEL, ARM_CARRY, ARM_LAID = 0.045, 0.012, 0.001
PUTTING = 0.4  # Fraction of full speed at which vertices are carried.
WORST = 8  # Number of candidate vertices, of which one or two are carried.
NEXT, APART = 3, 6  # Minimum segments between candidates, and between two carried vertices.
BEYOND = 1.0, 1.2  # Shares of the distance that a vertex is carried; the rope springs back.
ROOM = 0.05  # [m] Minimum distance of the two pickers.
SHARES = 0.7, 1.0, 1.4  # Shares for arms when `BEYOND` does not improve the shape.
GOOD = 0.004  # [m] Error up to which a vertex is not moved.
BEAM = 4  # Plans whose successors are tried if no plan improves the shape at once.
ERROR_PRICE = 23.0  # [1/m] Cost of the mean error of vertices in normalized performance.


class RopeConfiguration(RehearsingExpert):
    """Carries up to two vertices to their places, and repeats while the shape improves."""

    brakes = True

    def _begin(self):
        super()._begin()
        heights = TRAVEL, CARRY, LAID
        if self._has_arms:
            low = float(self._actor.limits[0][2])
            heights = low + ARM_TRAVEL, low + ARM_CARRY, low + ARM_LAID
        self._travel, self._carry, self._laid = heights

    def _episode(self) -> Iterator[np.ndarray]:
        while plan := self._next():
            yield from plan()
        yield from self._move(self._raised(self._travel), OPEN)

    def _next(self) -> Plan | None:
        """Returns the plan that brings the rope nearest to its shape, alone or with a successor."""
        value, plans = self._value(), self._puts()
        outcomes = self._outcomes(plans)
        best = np.argsort(-outcomes, kind="stable")[:BEAM]
        if len(best) and outcomes[best[0]] < value + GAIN:
            sequels = [self._outcome(plans[i], value=self._best_put) for i in best]
            outcomes[best] = sequels
            best = best[[int(np.argmax(sequels))]]
        if len(best) and outcomes[best[0]] >= value + GAIN:
            return plans[best[0]]
        return self._last_resort(value) if self._has_arms else None

    def _last_resort(self, value: float) -> Plan | None:
        """Returns the best plan to carry any single vertex, if it improves the shape."""
        goal = self._goal()
        error = np.linalg.norm(goal - self._target.points(), axis=1)
        plans = [
            functools.partial(self._put, {i: (v, goal[v])}, share)
            for v in np.flatnonzero(error >= GOOD).tolist()
            if self._grasp(v)[2] > 0.0
            for i in self._takers([v], goal)
            for share in SHARES
        ]
        outcomes = self._outcomes(plans)
        best = int(outcomes.argmax()) if plans else 0
        return plans[best] if plans and outcomes[best] >= value + GAIN else None

    def _best_put(self) -> float:
        return self._outcomes(self._puts()).max(initial=-math.inf)

    def _value(self) -> float:
        # A rope that is mostly placed but reversed needs more vertices than the key points.
        error = np.linalg.norm(self._goal() - self._target.points(), axis=1).mean()
        return super()._value() - ERROR_PRICE * float(error)

    def _goal(self) -> np.ndarray:
        """Returns the target shape (41, 3) [m], from the end that fits the rope."""
        goal, vertices = self._env.task.episode.goal["rope"], self._target.points()
        errors = [np.linalg.norm(vertices - g, axis=1).sum() for g in (goal, goal[::-1])]
        return goal if errors[0] <= errors[1] else goal[::-1]

    def _puts(self) -> list[Plan]:
        """Returns plans that carry one or two misplaced vertices to their places, or beyond."""
        goal, vertices = self._goal(), self._target.points()
        error = np.linalg.norm(goal - vertices, axis=1)
        room = max(ROOM, self._actor.least_distance)
        worst: list[int] = []
        for v in np.argsort(-error, kind="stable").tolist():
            if error[v] < GOOD or len(worst) == WORST:
                break
            if all(abs(v - w) >= NEXT for w in worst) and self._grasp(v)[2] > 0.0:
                worst.append(v)
        choices = [[v] for v in worst]
        for v, w in itertools.combinations(worst, 2):
            distances = length(vertices[v] - vertices[w]), length(goal[v] - goal[w])
            if abs(v - w) >= APART and min(distances) > room:
                choices.append([v, w])
        takers = [self._takers(chosen, goal) for chosen in choices]
        places = [{i: (v, goal[v]) for i, v in by.items()} for by in takers if by]
        return [functools.partial(self._put, p, beyond) for p in places for beyond in BEYOND]

    def _takers(self, vertices: list[int], goal: np.ndarray) -> dict[int, int]:
        """Returns vertices by gripper that can carry them to their places in `goal` (41, 3) [m].

        The result is empty if the grippers cannot carry all of them.
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
        """Returns whether gripper `i` reaches both a vertex and its place (3,) [m]."""
        above = place * [1.0, 1.0, 0.0] + [0.0, 0.0, self._laid]
        return self._can_reach(i, vertex) and np.allclose(self._actor.within_reach(i, above), above)

    def _put(
        self, places: dict[int, tuple[int, np.ndarray]], beyond: float
    ) -> Iterator[np.ndarray]:
        """Grasps vertices from above and carries them a multiple of the way to their places."""
        goals = self._raised(self._travel)
        for i, (vertex, _) in places.items():
            goals[i, :2] = self._grasp(vertex)[0][:2]
        idle = [i for i in range(2) if i not in places]
        for i in idle:
            goals = self._aside(goals, i)
        yield from self._move(self._raised(self._travel), OPEN, near=PASSED / 2)
        yield from self._move(goals, OPEN, near=PASSED / 5)
        for i, (vertex, _) in places.items():
            goals[i] = self._grasp(vertex)[0]
        yield from self._move(goals, OPEN)
        grips = [i in places for i in range(2)]
        yield self._step(self._actor.positions(), grips)
        goals = self._raised(self._carry)
        for i, (vertex, place) in places.items():
            goals[i] += beyond * (place - self._target.vertex(vertex)) * [1.0, 1.0, 0.0]
        for i in idle:
            goals = self._aside(goals, i)
        yield from self._move(goals, grips, PUTTING, near=PASSED / 5)
        for i in places:
            goals[i, 2] = self._laid
        yield from self._move(goals, grips, PUTTING, near=ARRIVED)
        yield self._rest(OPEN)
