"""`PickerExpert`: moves two pickers, or the hands of two arms, and finds how to take a vertex."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.expert import Expert
from softgym_mj.robots.gripper import MAX_DISPLACEMENT

OPEN, CLOSED = (False, False), (True, True)  # Grips of the two pickers.
ARRIVED = 0.003  # [m] Distance along every axis at which a goal counts as reached.
PASSED = 0.05  # [m] The same for a point on the way.
SLOW = 0.5  # Fraction of full speed at which something held is moved gently.
# How arms come to rest where they ought to: the share of the way left and the way [m] that they go
# in an env step at most, whichever is more, and the distance [m] at which a goal counts as reached.
# Measured with a Franka and a Sawyer: 3.2 instead of 4.5 env steps, 8 mm too far instead of 42 mm.
BRAKING, CREEP, STOPPED = 0.6, 0.02, 0.006
PROGRESS = 0.002  # [m] By which a gripper that is on its way comes nearer in an env step at least.
PATIENCE = 3  # Env steps without progress after which a goal is given up: something is in the way.
ASIDE = 0.25  # [m] Along Y, how far a hand that has nothing to do keeps away from the other one.
CLEAR = 0.003  # [m] Clearance from which a vertex counts as fully exposed.


def _directions() -> np.ndarray:
    """Unit vectors (n, 3) over the upper half-sphere, the vertical first."""
    rows = [(90, 1), (70, 12), (52, 12), (35, 12), (18, 12), (0, 12)]  # (elevation [deg], number)
    angles = [(math.radians(e), 2 * math.pi * k / n) for e, n in rows for k in range(n)]
    sin, cos = math.sin, math.cos
    return np.array([(cos(e) * cos(a), cos(e) * sin(a), sin(e)) for e, a in angles])


_DIRECTIONS = _directions()


class PickerExpert(Expert):
    """Moves two pickers."""

    margin = 0.00225  # [m] By which a vertex is taken from nearer than the pick distance.
    brakes = False  # Whether arms slow down before they arrive.

    def __init__(self, env: Environment):
        """Binds the expert.

        Args:
            env: environment of the expert's task, with two pickers.

        Raises:
            InvalidArgumentError: for another number of grippers, or if actions are no ways.
        """
        self._actor, self._target = env.task.actor, env.task.objects[0]
        if not self._actor.displaces:
            valid = "an actor whose actions say by how much grippers move"
            raise InvalidArgumentError("actor", self._actor.name, valid)
        if self._actor.num_grippers != 2:
            raise InvalidArgumentError("num_grippers", self._actor.num_grippers, "2")
        self._has_arms = self._actor.least_distance > 0.0
        self._stride = MAX_DISPLACEMENT * env.task.action_repeat
        self._reach = self._actor.pick_distance - self.margin
        super().__init__(env)

    def _step(self, goals: np.ndarray, grips: Sequence[bool], speed: float = 1.0) -> np.ndarray:
        """Action that moves the pickers straight towards `goals` (2, 3) [m] at `speed`."""
        commanded = self._actor.commanded_positions()
        delta = (self._within_reach(goals) - commanded) / self._stride
        delta *= speed / max(np.abs(delta).max(), speed)
        return self._actor.displacing(delta, grips)

    def _within_reach(self, goals: np.ndarray) -> np.ndarray:
        """The points (2, 3) [m] nearest to `goals` (2, 3) that the grippers can go to."""
        clipped = np.clip(goals, *self._actor.limits)
        return np.array([self._actor.within_reach(i, goal) for i, goal in enumerate(clipped)])

    def _gets_to(self, goals: np.ndarray) -> bool:
        """Whether the grippers can go to `goals` (2, 3) [m], as far as the workspace goes."""
        return np.allclose(self._within_reach(goals), np.clip(goals, *self._actor.limits))

    def _can_reach(self, i: int, vertex: int) -> bool:
        """Whether gripper `i` gets to where a vertex is taken from."""
        center = self._grasp(vertex)[0]
        return length(self._actor.within_reach(i, center) - center) < ARRIVED

    def _own_sides(self) -> np.ndarray:
        """The directions along Y (2,) in which the grippers' own sides are."""
        y = self._actor.positions()[:, 1]
        return np.sign(y - y[::-1])

    def _aside(self, goals: np.ndarray, i: int) -> np.ndarray:
        """Goals (2, 3) [m] where gripper `i` is out of the way of the other one, on its side."""
        goals = goals.copy()
        if self._has_arms:
            side = self._own_sides()[i]
            goals[i, 1] = side * max(side * goals[i, 1], side * goals[1 - i, 1] + ASIDE)
        return goals

    def _move(self, goals, grips, speed=1.0, near=ARRIVED) -> Iterator[np.ndarray]:
        """Actions until both grippers are within `near` [m] of `goals`, as far as they can go.

        Arms that get in each other's way end it early.
        """
        goals = self._within_reach(goals)
        nearest, waited = np.full(2, np.inf), 0
        stops = self.brakes and self._has_arms and near <= ARRIVED
        near = STOPPED if stops else near
        while (left := np.abs(goals - self._actor.positions()).max(axis=1)).max() >= near:
            gained = left < nearest - PROGRESS
            nearest = np.where(gained, left, nearest)
            waited = 0 if gained.any() else waited + 1
            if waited > PATIENCE:
                return
            yield self._step(goals, grips, min(speed, self._braking(goals)) if stops else speed)

    def _braking(self, goals: np.ndarray) -> float:
        """Fraction of full speed from which arms come to rest at `goals` (2, 3) [m]."""
        left = float(np.abs(goals - self._actor.commanded_positions()).max())
        return max(BRAKING * left, CREEP) / self._stride

    def _raised(self, height: float) -> np.ndarray:
        """Picker centers (2, 3) [m], lifted to `height` [m]."""
        positions = self._actor.positions()
        positions[:, 2] = height
        return positions

    def _rest(self, grips) -> np.ndarray:
        """Action that stays in place."""
        return self._step(self._actor.commanded_positions(), grips)

    def _idle(self) -> np.ndarray:
        return self._rest(self._actor.held >= 0)

    def _matched(self, vertices: Sequence[int]) -> list[int]:
        """Two vertices in the order of the grippers.

        That of the shorter ways, but grippers that must keep apart stay on their sides.
        """
        if self._has_arms:
            order = self._actor.order(self._target.points()[list(vertices)])
            return [vertices[i] for i in order]
        starts, goals = self._actor.positions(), self._target.points()[list(vertices)]
        direct = np.linalg.norm(starts - goals, axis=1).sum()
        crossed = np.linalg.norm(starts - goals[::-1], axis=1).sum()
        return list(vertices) if direct <= crossed else list(vertices)[::-1]

    def _grasp(self, vertex: int) -> tuple[np.ndarray, np.ndarray, float]:
        """How to take a vertex: picker center (3,) [m], direction (3,) and clearance [m].

        The clearance is how much further the next vertex is; negative: another one is taken.
        """
        centers = self._target.vertex(vertex) + self._reach * _DIRECTIONS
        centers = np.clip(centers, *self._actor.limits)
        distance = np.linalg.norm(centers[:, None] - self._target.points(), axis=2)
        own = distance[:, vertex].copy()
        distance[:, vertex] = np.inf
        clearance = distance.min(axis=1) - own
        clearance[own > self._actor.pick_distance] = -1.0
        best = int(np.argmax(np.minimum(clearance, CLEAR)))
        return centers[best], _DIRECTIONS[best], float(min(clearance[best], CLEAR))
