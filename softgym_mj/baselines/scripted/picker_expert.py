"""`PickerExpert`: moves two pickers and finds how to take a vertex."""

from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.baselines.scripted.expert import Expert
from softgym_mj.environment import Environment
from softgym_mj.exceptions import OutOfRangeError
from softgym_mj.robots.holding import MAX_DISPLACEMENT

OPEN, CLOSED = (False, False), (True, True)  # Grips of the two pickers.
ARRIVED = 0.003  # [m] Distance along every axis at which a goal counts as reached.
PASSED = 0.05  # [m] The same for a point on the way.
SLOW = 0.5  # Fraction of full speed at which something held is moved gently.
CLEAR = 0.003  # [m] Clearance from which a vertex counts as fully exposed.


def _directions() -> np.ndarray:
    """Unit vectors (n, 3) over the upper half-sphere, the vertical first."""
    rows = [(90, 1), (70, 12), (52, 12), (35, 12), (18, 12), (0, 12)]  # (elevation [deg], number)
    angles = [(np.deg2rad(e), 2 * np.pi * k / n) for e, n in rows for k in range(n)]
    return np.array([(np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)) for e, a in angles])


_DIRECTIONS = _directions()


class PickerExpert(Expert):
    """Moves two pickers."""

    margin = 0.00225  # [m] By which a vertex is taken from nearer than the pick distance.

    def __init__(self, env: Environment):
        """Binds the expert.

        Args:
            env: environment of the expert's task, with two pickers.

        Raises:
            OutOfRangeError: for another number of grippers.
        """
        self._actor, self._target = env.task.actor, env.task.target
        if self._actor.num_grippers != 2:
            raise OutOfRangeError("num_grippers", self._actor.num_grippers, "2")
        self._stride = MAX_DISPLACEMENT * env.task.action_repeat
        self._reach = self._actor.pick_distance - self.margin
        super().__init__(env)

    def _step(self, goals: np.ndarray, grips: Sequence[bool], speed: float = 1.0) -> np.ndarray:
        """Action (8,) that moves the pickers straight towards `goals` (2, 3) [m] at `speed`."""
        commanded = self._actor.commanded_positions()
        delta = (np.clip(goals, *self._actor.limits) - commanded) / self._stride
        delta *= speed / max(np.abs(delta).max(), speed)
        return np.column_stack([delta, np.where(grips, 1.0, -1.0)]).ravel()

    def _move(self, goals, grips, speed=1.0, near=ARRIVED) -> Iterator[np.ndarray]:
        """Actions until both pickers are within `near` [m] of `goals`, clipped to the workspace."""
        goals = np.clip(goals, *self._actor.limits)
        while np.abs(goals - self._actor.positions()).max() >= near:
            yield self._step(goals, grips, speed)

    def _raised(self, height: float) -> np.ndarray:
        """Picker centres (2, 3) [m], lifted to `height` [m]."""
        positions = self._actor.positions()
        positions[:, 2] = height
        return positions

    def _rest(self, grips) -> np.ndarray:
        """Action that stays in place."""
        return self._step(self._actor.commanded_positions(), grips)

    def _matched(self, vertices: Sequence[int]) -> list[int]:
        """Two vertices in the order of the pickers that reaches them on the shorter ways."""
        starts, goals = self._actor.positions(), self._target.vertices()[list(vertices)]
        direct = np.linalg.norm(starts - goals, axis=1).sum()
        crossed = np.linalg.norm(starts - goals[::-1], axis=1).sum()
        return list(vertices) if direct <= crossed else list(vertices)[::-1]

    def _grasp(self, vertex: int) -> tuple[np.ndarray, np.ndarray, float]:
        """How to take a vertex: picker centre (3,) [m], direction (3,) and clearance [m].

        The clearance is how much further the next vertex is; negative: another one is taken.
        """
        centres = self._target.vertex(vertex) + self._reach * _DIRECTIONS
        centres = np.clip(centres, *self._actor.limits)
        distance = np.linalg.norm(centres[:, None] - self._target.vertices(), axis=2)
        own = distance[:, vertex].copy()
        distance[:, vertex] = np.inf
        clearance = distance.min(axis=1) - own
        clearance[own > self._actor.pick_distance] = -1.0
        best = int(np.argmax(np.minimum(clearance, CLEAR)))
        return centres[best], _DIRECTIONS[best], float(min(clearance[best], CLEAR))
