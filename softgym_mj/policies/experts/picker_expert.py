"""`PickerExpert`: base class of experts that move two pickers or arms, and their grasps."""

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
# Braking of arms: per env step they move at most this share of the remaining distance or this
# distance [m], whichever is larger; and the distance [m] at which a goal counts as reached.
# Measured with a Franka and a Sawyer: 3.2 instead of 4.5 env steps, 8 mm overshoot instead of 42.
BRAKING, CREEP, STOPPED = 0.6, 0.02, 0.006
PROGRESS = 0.002  # [m] Minimum approach of a moving gripper per env step.
PATIENCE = 3  # Env steps without progress after which a goal counts as blocked.
ASIDE = 0.25  # [m] Distance along Y of an idle hand from the other one.
CLEAR = 0.003  # [m] Clearance from which a vertex counts as fully exposed.


def _directions() -> np.ndarray:
    """Returns unit vectors (n, 3) over the upper half-sphere, the vertical first."""
    rows = [(90, 1), (70, 12), (52, 12), (35, 12), (18, 12), (0, 12)]  # (elevation [deg], number)
    angles = [(math.radians(e), 2 * math.pi * k / n) for e, n in rows for k in range(n)]
    sin, cos = math.sin, math.cos
    return np.array([(cos(e) * cos(a), cos(e) * sin(a), sin(e)) for e, a in angles])


_DIRECTIONS = _directions()


class PickerExpert(Expert):
    """Expert for two pickers or arms: motions and grasps of single vertices."""

    margin = 0.00225  # [m] Difference between the pick distance and the grasp distance.
    brakes = False  # Whether arms slow down before a goal.

    def __init__(self, env: Environment):
        """Binds the expert.

        Raises:
            InvalidArgumentError: unless two grippers have actions that are displacements.
        """
        self._actor, self._target = env.task.actor, env.task.objects[0]
        if not self._actor.displaces:
            valid = "an actor whose actions are displacements of grippers"
            raise InvalidArgumentError("actor", self._actor.name, valid)
        if self._actor.num_grippers != 2:
            valid = "2 for the scripted expert"
            raise InvalidArgumentError(self._actor.counted_by, self._actor.num_grippers, valid)
        self._has_arms = self._actor.least_distance > 0.0
        self._stride = MAX_DISPLACEMENT * env.task.action_repeat
        self._reach = self._actor.pick_distance - self.margin
        super().__init__(env)

    def _step(self, goals: np.ndarray, grips: Sequence[bool], speed: float = 1.0) -> np.ndarray:
        """Returns the action that moves the pickers straight to `goals` (2, 3) [m] at `speed`."""
        commanded = self._actor.commanded_positions()
        delta = (self._within_reach(goals) - commanded) / self._stride
        delta *= speed / max(np.abs(delta).max(), speed)
        return self._actor.displacing(delta, grips)

    def _within_reach(self, goals: np.ndarray) -> np.ndarray:
        """Returns the reachable points (2, 3) [m] nearest to `goals` (2, 3)."""
        clipped = np.clip(goals, *self._actor.limits)
        return np.array([self._actor.within_reach(i, goal) for i, goal in enumerate(clipped)])

    def _gets_to(self, goals: np.ndarray) -> bool:
        """Returns whether `goals` (2, 3) [m] are inside the grippers' workspaces."""
        return np.allclose(self._within_reach(goals), np.clip(goals, *self._actor.limits))

    def _can_reach(self, i: int, vertex: int) -> bool:
        """Returns whether gripper `i` can reach the grasp position of a vertex."""
        center = self._grasp(vertex)[0]
        return length(self._actor.within_reach(i, center) - center) < ARRIVED

    def _own_sides(self) -> np.ndarray:
        """Returns the signs along Y (2,) of the grippers' own sides."""
        y = self._actor.positions()[:, 1]
        return np.sign(y - y[::-1])

    def _aside(self, goals: np.ndarray, i: int) -> np.ndarray:
        """Returns goals (2, 3) [m] with gripper `i` on its side, out of the other one's way."""
        goals = goals.copy()
        if self._has_arms:
            side = self._own_sides()[i]
            goals[i, 1] = side * max(side * goals[i, 1], side * goals[1 - i, 1] + ASIDE)
        return goals

    def _move(self, goals, grips, speed=1.0, near=ARRIVED) -> Iterator[np.ndarray]:
        """Yields actions until both grippers are within `near` [m] of the reachable `goals`.

        It ends early if arms block each other.
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
        """Returns the fraction of full speed at which arms stop at `goals` (2, 3) [m]."""
        left = float(np.abs(goals - self._actor.commanded_positions()).max())
        return max(BRAKING * left, CREEP) / self._stride

    def _raised(self, height: float) -> np.ndarray:
        """Returns the picker centers (2, 3) [m], lifted to `height` [m]."""
        positions = self._actor.positions()
        positions[:, 2] = height
        return positions

    def _rest(self, grips) -> np.ndarray:
        """Returns the action that stays in place."""
        return self._step(self._actor.commanded_positions(), grips)

    def _idle(self) -> np.ndarray:
        return self._rest(self._actor.held >= 0)

    def _matched(self, vertices: Sequence[int]) -> list[int]:
        """Returns two vertices in the order of the grippers.

        The order has the shorter distances, but grippers that must keep apart stay on their sides.
        """
        if self._has_arms:
            order = self._actor.order(self._target.points()[list(vertices)])
            return [vertices[i] for i in order]
        starts, goals = self._actor.positions(), self._target.points()[list(vertices)]
        direct = np.linalg.norm(starts - goals, axis=1).sum()
        crossed = np.linalg.norm(starts - goals[::-1], axis=1).sum()
        return list(vertices) if direct <= crossed else list(vertices)[::-1]

    def _grasp(self, vertex: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Returns the grasp of a vertex: picker center (3,) [m], direction (3,) and clearance [m].

        The clearance is how much farther the next vertex is; if negative, another one is grasped.
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
