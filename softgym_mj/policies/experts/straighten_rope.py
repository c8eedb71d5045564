"""The expert of StraightenRope: takes both ends, pulls them apart, lays the rope down."""

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
# Where grippers have no room to take both ends at once [m]: how much more than the room one end is
# drawn away from the other, how far an end is carried across.
DRAWN, ACROSS = 0.01, 0.2
FAR = 1.0  # [m] More than any workspace.


class StraightenRope(PickerExpert):
    """Takes both ends from above, pulls them apart and lays the rope down.

    Where the ends are too close together for both grippers, one of them is drawn aside first; where
    one is out of a gripper's reach, the grippers change ends.
    """

    margin = 0.006  # A thinner rope lies lower.

    def _episode(self):
        while not (self._actor.held >= 0).all():
            ends = yield from self._take_both()  # Anew, if one is torn away.
            yield from self._move(self._raised(ROPE_LIFT), CLOSED, SLOW)
            yield from self._pull_apart(ends)
            laid = self._actor.commanded_positions()
            laid[:, 2] = ROPE_LAID
            yield from self._move(laid, CLOSED, ROPE_SPEED)

    def _pull_apart(self, ends: Sequence[int]) -> Iterator[np.ndarray]:
        """Brings both ends as far from each other as the rope is long, around the middle."""
        rope, center = self._env.task.rope, np.mean(self._actor.limits, axis=0)
        waited = 0
        while waited < PATIENCE and (self._actor.held >= 0).all():
            # Where the ends are once the grippers are where they are told to be: arms lag behind.
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
        """Takes both ends; the value is which one each gripper holds."""
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
            # The grippers change ends: one brings its own to where the other reaches it.
            yield from self._carry_across(ends, int(np.argmax(taken)))

    def _short(self, ends: Sequence[int]) -> list[int]:
        """The grippers that hold nothing and do not reach their ends."""
        return [
            i for i, v in enumerate(ends) if self._actor.held[i] < 0 and not self._can_reach(i, v)
        ]

    def _take(self, ends: Sequence[int], takers: Sequence[int]) -> Iterator[np.ndarray]:
        """The grippers `takers` take their ends from above; the others keep what they hold.

        They try it until they have them, or these are out of their reach or behind another one.
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
            goals = self._raised(ROPE_LIFT)  # What covers an end: hands lay it aside.
            goals[takers, 1] += self._actor.least_distance * self._own_sides()[takers]
            yield from self._move(goals, self._actor.held >= 0)

    def _take_alone(self, ends: Sequence[int], taker: int) -> Iterator[np.ndarray]:
        """One gripper takes its end; the other one makes room."""
        goals = self._raised(ROPE_APPROACH)
        goals[taker, :2] = self._target.vertex(ends[taker])[:2]
        goals = self._aside(goals, 1 - taker)
        yield from self._move(goals, OPEN, near=PASSED)
        yield from self._take(ends, [taker])

    def _draw_aside(self, ends: Sequence[int]) -> Iterator[np.ndarray]:
        """One gripper takes its end and draws it away from the other, towards its own side.

        It is the one that has less of its reach left, as the other end may come along.
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
        """A gripper lays its end down on the other side of the other end.

        That is in the middle at least, where both grippers reach.
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
