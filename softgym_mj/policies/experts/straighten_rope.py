"""Expert of StraightenRope: grasps both ends, pulls them apart and lays the rope down."""

from collections.abc import Generator, Iterator, Sequence

import numpy as np

from softgym_mj.entities.rope import LENGTH
from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.picker_expert import (
    CLOSED,
    OPEN,
    PASSED,
    PATIENCE,
    SLOW,
    PickerExpert,
)

# Heights [m] of the picker centers above a rope: passing over, pulling, at the end.
ROPE_APPROACH, ROPE_LIFT, ROPE_LAID = 0.1, 0.1, 0.04
ROPE_TOLERANCE = 0.001  # [m] Error of the end distance at which pulling stops.
ROPE_SPEED = 0.3  # Fraction of full speed at which the rope is pulled.
# If the ends are too close for both grippers [m]: extra distance beyond the required room by which
# an end is drawn away, and distance by which an end is carried across.
DRAWN, ACROSS = 0.01, 0.2
FAR = 1.0  # [m] Larger than any workspace.


class StraightenRope(PickerExpert):
    """Grasps both ends from above, pulls them apart and lays the rope down.

    If the ends are too close together for both grippers, one of them is drawn aside first; if an
    end is out of a gripper's reach, the grippers exchange ends.
    """

    margin = 0.006  # Larger than the default: a thinner rope lies lower.

    def _episode(self):
        while not (self._actor.held >= 0).all():
            ends = yield from self._take_both()  # Repeats if an end is torn away.
            yield from self._move(self._raised(ROPE_LIFT), CLOSED, SLOW)
            yield from self._pull_apart(ends)
            laid = self._actor.commanded_positions()
            laid[:, 2] = ROPE_LAID
            yield from self._move(laid, CLOSED, ROPE_SPEED)

    def _pull_apart(self, ends: Sequence[int]) -> Iterator[np.ndarray]:
        """Pulls both ends apart to the length of the rope, about its center."""
        rope, center = self._env.task.rope, np.mean(self._actor.limits, axis=0)
        waited = 0
        while waited < PATIENCE and (self._actor.held >= 0).all():
            # Positions of the ends when the grippers reach their targets; arms lag behind.
            commanded = self._actor.commanded_positions()
            points = self._target.points()[list(ends)] + commanded - self._actor.positions()
            error = LENGTH - length(points[0] - points[1])
            if abs(error) <= ROPE_TOLERANCE:
                if abs(LENGTH - rope.end_distance()) <= ROPE_TOLERANCE:
                    return
                waited += 1
            line = (points[0] - points[1]) * [1.0, 1.0, 0.0]
            line *= error / 2 / (length(line) + 1e-9)
            to_center = (center - commanded.mean(axis=0)) * [1.0, 1.0, 0.0]
            yield self._step(commanded + [line, -line] + to_center, CLOSED, ROPE_SPEED)

    def _take_both(self) -> Generator[np.ndarray, None, list[int]]:
        """Grasps both ends; returns the end of each gripper."""
        rope = self._env.task.rope
        while True:
            ends = self._matched(rope.ends)
            short = self._short(ends)
            if short:
                yield from self._take_alone(ends, 1 - short[0])
            elif rope.end_distance() < self._actor.least_distance:
                yield from self._draw_aside(ends)
            free = np.flatnonzero(self._actor.held < 0).tolist()
            if free and not self._short(ends):
                yield from self._take(ends, free)
            taken = np.isin(self._actor.held, ends)
            if taken.all():
                return ends
            # To exchange ends, a gripper brings its own into the other's reach.
            yield from self._carry_across(ends, int(np.argmax(taken)))

    def _short(self, ends: Sequence[int]) -> list[int]:
        """Returns the empty grippers that do not reach their ends."""
        return [
            i for i, v in enumerate(ends) if self._actor.held[i] < 0 and not self._can_reach(i, v)
        ]

    def _take(self, ends: Sequence[int], takers: Sequence[int]) -> Iterator[np.ndarray]:
        """Grasps ends with the grippers `takers` from above; the others keep theirs.

        It ends when they hold their ends, or when these are out of reach or covered.
        """
        takers = list(takers)
        while True:
            holds = (self._actor.held >= 0) & ~np.isin([0, 1], takers)
            yield from self._move(self._raised(ROPE_APPROACH), holds, near=PASSED)
            for lift in (ROPE_APPROACH, 0.0):
                goals = self._actor.positions()
                for i in takers:
                    goals[i] = self._grasp(ends[i])[0]
                    goals[i, 2] = max(goals[i, 2], lift)
                yield from self._move(goals, holds, SLOW if lift == 0.0 else 1.0)
            blocked = np.abs(goals - self._actor.positions()).max() > PASSED
            yield self._rest(holds | np.isin([0, 1], takers))
            takers = [i for i in takers if self._actor.held[i] not in ends]
            if not takers or blocked or not all(self._can_reach(i, ends[i]) for i in takers):
                return
            goals = self._raised(ROPE_LIFT)  # Hands lay rope that covers an end aside.
            goals[takers, 1] += self._actor.least_distance * self._own_sides()[takers]
            yield from self._move(goals, self._actor.held >= 0)

    def _take_alone(self, ends: Sequence[int], taker: int) -> Iterator[np.ndarray]:
        """Grasps an end with one gripper; the other one makes room."""
        goals = self._raised(ROPE_APPROACH)
        goals[taker, :2] = self._target.vertex(ends[taker])[:2]
        goals = self._aside(goals, 1 - taker)
        yield from self._move(goals, OPEN, near=PASSED)
        yield from self._take(ends, [taker])

    def _draw_aside(self, ends: Sequence[int]) -> Iterator[np.ndarray]:
        """Grasps an end with one gripper and draws it away from the other, to its own side.

        It is the gripper with less reach left, as the other end may be dragged along.
        """
        points, sides = self._target.points()[list(ends)], self._own_sides()
        furthest = self._within_reach(points - sides[:, None] * [0.0, FAR, 0.0])
        first = int(np.argmin(np.linalg.norm(furthest - points, axis=1)))
        yield from self._take_alone(ends, first)
        goals = self._raised(ROPE_LIFT)
        goals[first, 1] += sides[first] * FAR
        for action in self._move(goals, self._actor.held >= 0, SLOW):
            if self._env.task.rope.end_distance() > self._actor.least_distance + DRAWN:
                return
            yield action

    def _carry_across(self, ends: Sequence[int], holder: int) -> Iterator[np.ndarray]:
        """Lays a held end down on the other side of the other end.

        The place is at least in the middle, where both grippers reach.
        """
        grips = np.array([holder == 0, holder == 1])
        goals, side = self._raised(ROPE_LIFT), self._own_sides()[1 - holder]
        middle = np.mean(self._actor.limits, axis=0)[1]
        across = self._target.vertex(ends[1 - holder])[1] + side * ACROSS
        goals[holder, 1] = side * max(side * across, side * middle)
        goals = self._aside(goals, 1 - holder)
        yield from self._move(goals, grips, SLOW, PASSED)
        goals[:, 2] = ROPE_LAID
        yield from self._move(goals, grips, SLOW, PASSED / 5)
        yield self._rest(OPEN)
