"""`ClothExpert`: base class of experts that grasp vertices of a sheet."""

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.picker_expert import ARRIVED, OPEN, PASSED, SLOW, PickerExpert

ARM_REACH = 0.018  # [m] Grasp distance of hands; farther away, other vertices of a pile are nearer.
LAYER = 0.01  # [m] Height of a cloth layer.
STANDOFF = 0.06  # [m] Further distance at which an approach starts.
TRAVEL_HEIGHT = 0.25  # [m] Height of the picker centers between places, above every pile.
NEAR_GOAL = 2  # Grid steps from a target vertex within which a grasp counts as one of it.
OVERSHOOT = 0.02  # [m] Distance that a vertex is pulled beyond its place; cloth springs back.
MISPLACED = 0.04  # [m] Distance from its place from which a vertex is worth a move.
APART = 0.15  # [m] Minimum distance of two places at which the pickers work at the same time.
TRIALS = 4  # Maximum number of grasps of a pair; the last two may be anywhere.
LIFT = 0.8  # Fraction of full speed while cloth is carried.


class ClothExpert(PickerExpert):
    """Expert for a sheet: grid distances, flat positions, and grasps of vertices."""

    closing = 1  # Env steps for which a hand that has arrived closes.

    def __init__(self, env: Environment):
        """Binds the expert, as `PickerExpert`."""
        super().__init__(env)
        if self._has_arms:
            self._reach = ARM_REACH

    def _steps(self, a: int, b: int) -> int:
        """Grid steps between two vertices, diagonal ones counted once."""
        columns = self._env.task.cloth.shape[1]
        return max(abs(a // columns - b // columns), abs(a % columns - b % columns))

    def _nearest(self, vertex: int, goals: Sequence[int]) -> int | None:
        """Returns the one of `goals` that is near a vertex, or None."""
        goal = min(goals, key=lambda g: self._steps(g, vertex))
        return goal if vertex >= 0 and self._steps(goal, vertex) <= NEAR_GOAL else None

    def _clearance(self, i: int, vertex: int) -> float:
        """Returns the clearance [m] of a grasp of a vertex by gripper `i`; negative: no grasp."""
        return self._grasp(vertex)[2] if self._can_reach(i, vertex) else -1.0

    def _exposed_near(self, goals: Sequence[int], taker: int | None = None, rank: int = 0) -> int:
        """Returns the graspable free vertex with the fewest grid steps to one of `goals`.

        `taker` is the gripper, None for the nearest one; `rank` nearer vertices are skipped.
        """
        free = np.setdiff1d(np.arange(self._target.num_points), self._actor.held).tolist()
        free.sort(key=lambda v: min(self._steps(g, v) for g in goals))
        takers = (self._nearest_picker(v) if taker is None else taker for v in free)
        can_take = (v for i, v in zip(takers, free, strict=True) if self._clearance(i, v) > 0.0)
        return next(itertools.islice(can_take, rank, None), free[0])

    def _take(
        self, targets: dict[int, int], grips: list[bool], away: float = NEAR_GOAL
    ) -> Iterator[np.ndarray]:
        """Grasps vertices, `targets` by picker; sets `grips` of successful pickers.

        A grasp succeeds if the held vertex is within `away` grid steps of its target.
        """
        up = self._actor.positions()
        for i in targets:
            up[i, 2] = max(TRAVEL_HEIGHT, up[i, 2])
        yield from self._move(up, grips, near=PASSED)
        for stage, near in (("over", PASSED), ("standoff", PASSED / 2), ("grasp", ARRIVED)):
            goals = self._actor.positions()
            for i, vertex in targets.items():
                center, direction, _ = self._grasp(vertex)
                goals[i] = center + STANDOFF * direction * (stage != "grasp")
                if stage == "over":
                    goals[i, 2] = max(goals[i, 2], up[i, 2])
            for i in range(2):
                if i not in targets and not grips[i]:
                    goals = self._aside(goals, i)
            yield from self._move(goals, grips, near=near)
        for i in targets:
            grips[i] = True
        for _ in range(self.closing if self._has_arms else 1):
            yield self._step(goals, grips)
        for i, vertex in targets.items():
            held = int(self._actor.held[i])
            grips[i] = bool(held >= 0 and self._steps(held, vertex) <= away)

    def _nearest_picker(self, vertex: int) -> int:
        offsets = self._actor.positions() - self._target.vertex(vertex)
        return int(np.argmin(np.linalg.norm(offsets, axis=1)))

    def _take_pair(
        self, pairs: Sequence[tuple[int, int, float]], grips: list[bool], rank: int
    ) -> Iterator[np.ndarray]:
        """Grasps both vertices of a pair, one after the other if the cloth must be lifted.

        Args:
            pairs: Candidates (vertex, vertex, distance in the flat cloth [m]).
            grips: Grips of the pickers; set if the grasp succeeds.
            rank: Rank of the first vertex if both are hidden.
        """
        low, high = self._actor.limits
        ends = sorted({vertex for a, b, _ in pairs for vertex in (a, b)})
        clear = {v: self._grasp(v)[2] for v in ends}
        a, b, _ = max(pairs, key=lambda pair: (min(clear[pair[0]], clear[pair[1]]), pair[2]))
        targets = dict(enumerate(self._matched([a, b])))
        if min(self._clearance(i, v) for i, v in targets.items()) > 0.0:
            yield from self._take(targets, grips)
        for trial in range(TRIALS):
            at_end = [self._nearest(int(held), ends) is not None for held in self._actor.held]
            if all(grips):
                if all(at_end) or trial >= TRIALS - 2:
                    return
                grips[int(at_end[0])] = False  # Continue with the one at an end.
            if not any(grips):
                vertex = self._exposed_near(ends, rank=rank)
                yield from self._take({self._nearest_picker(vertex): vertex}, grips)
                if not any(grips):
                    continue
            holding = int(np.argmax(grips))
            goals = self._actor.positions()
            if goals[holding, 2] < high[2] - PASSED:
                side = low[1] if goals[1 - holding, 1] < goals[holding, 1] else high[1]
                goals[1 - holding, 1:] = side, TRAVEL_HEIGHT
                goals[holding] = [*(low + high)[:2] / 2, high[2]]
                yield from self._move(goals, grips, LIFT, PASSED)
                yield self._step(goals, grips)
            end = self._nearest(int(self._actor.held[holding]), ends)
            near = {v: 0.0 for v in ends}
            if end is not None:
                near = {a if b == end else b: n for a, b, n in pairs if end in (a, b)}
            other = 1 - holding
            vertex = max(near, key=lambda v: (self._clearance(other, v), near[v]))
            if self._clearance(other, vertex) <= 0.0:
                vertex = self._exposed_near(list(near), other)
            yield from self._take({other: vertex}, grips)

    def _wait(self) -> Iterator[np.ndarray]:
        """Moves the pickers out of the way."""
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN)

    def _misplaced(self, placed: np.ndarray) -> list[int]:
        """Returns up to two graspable vertices far from their places (n, 3) [m]."""
        vertices = self._target.points()
        value = np.linalg.norm((placed - vertices)[:, :2], axis=1)
        value[self._env.task.cloth.corners] *= 1.5
        chosen: list[int] = []
        for v in np.argsort(-value, kind="stable").tolist():
            if value[v] < MISPLACED or len(chosen) == 2:
                break
            apart = [
                np.linalg.norm(points[v] - points[chosen], axis=1) for points in (placed, vertices)
            ]
            if np.min(apart, initial=np.inf) > APART and self._grasp(v)[2] > 0.0:
                chosen.append(v)
        return chosen

    def _put(self, chosen: list[int], placed: np.ndarray) -> Iterator[np.ndarray]:
        """Grasps vertices, carries them in an arc and releases them at their places (n, 3) [m].

        A vertex that is grasped instead of the chosen one is put to its own place.
        """
        if len(chosen) == 2:
            targets = dict(enumerate(self._matched(chosen)))
        else:
            targets = {self._nearest_picker(v): v for v in chosen}
        grips = [False, False]
        yield from self._take(targets, grips, math.inf)
        start, goals = self._actor.positions(), self._actor.positions()
        for i in targets:
            goals[i, 2] = TRAVEL_HEIGHT
            if grips[i]:
                vertex = int(self._actor.held[i])
                way = placed[vertex] - self._target.vertex(vertex)
                goals[i] += way + OVERSHOOT * way / length(way)
                goals[i, 2] = self._actor.limits[0][2]
        arc = (start + goals) / 2
        arc[:, 2] = np.maximum(arc[:, 2], np.linalg.norm(goals - start, axis=1) / 2)
        yield from self._move(arc, grips, SLOW, PASSED)
        yield from self._move(goals, grips, SLOW)
        yield self._step(self._raised(TRAVEL_HEIGHT), OPEN)
