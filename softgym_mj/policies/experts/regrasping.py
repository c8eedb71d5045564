"""`RegraspingExpert`: takes a cloth that hangs from both grippers by other vertices."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.policies.experts.cloth_expert import ClothExpert
from softgym_mj.policies.experts.picker_expert import CLOSED

REACH = 0.055  # [m] From which a vertex is taken: there, pickers touch it.
NEARBY = 0.075  # [m] From where a picker that closes on its way takes the vertex nearest to it.
CLEAR = 0.02  # [m] By which the next vertex ought to be further away.
STANDOFF = 0.06  # [m] Further distance at which a vertex that swings is awaited.
OUTSIDE = 0.25  # [m] Distance from the hanging cloth at which a gripper passes it on its way down.
ROOM = 0.1  # [m] Between the lowest grippers and a vertex that is to be taken from the side.
DETOUR = 0.1  # [m] Of clearance for which a gripper goes 1 m further.
GRAVITY = 9.81  # [m/s^2]
THROW = 3  # Env steps at full speed upwards, after which a cloth that is let go flies on.
FLIGHT = 6  # Env steps within which it is taken again.
FROM_ABOVE = math.radians(10.0)  # Elevation of a gripper that takes a vertex from outside.


def _directions() -> np.ndarray:
    """Unit vectors (n, 3) every 15 degrees, around +Y: beside a sheet that spans along Y."""
    elevations = np.radians(np.arange(-45, 61, 15))
    return np.array(
        [
            (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e))
            for e in elevations
            for a in np.radians(np.arange(15, 166, 15))
        ]
    )


_DIRECTIONS = _directions()


class RegraspingExpert(ClothExpert):
    """Takes hanging cloth anew, one gripper after the other, while it hangs from the other one."""

    def _regrasp(
        self, targets: list[int], order: Sequence[int], swinging: float, latest: int
    ) -> Iterator[np.ndarray]:
        """Takes a vertex with each gripper; gives up after `latest` env steps of the episode.

        Args:
            targets: the vertices.
            order: of the grippers.
            swinging: speed of a vertex [m/s] from which it is awaited.
            latest: env step.
        """
        for i in order:
            if self._actor.held[i] != targets[i]:
                yield from self._fetch(i, targets[i], swinging, latest)

    def _fetch(self, i: int, vertex: int, swinging: float, latest: int) -> Iterator[np.ndarray]:
        """Lets go with gripper `i` and takes a vertex as soon as it is the nearest one."""
        other, low = 1 - i, self._actor.limits[0][2]
        flat, held = self._env.task.cloth.flat(), int(self._actor.held[other])
        lift = low + ROOM + float(np.linalg.norm(flat[vertex] - flat[held]))
        side, taking, grips = np.sign(flat[vertex, 1]), False, list(CLOSED)
        while self._env.step_count < latest and self._actor.held[other] == held >= 0:
            if taking and self._actor.held[i] == vertex:
                return
            goals = self._actor.positions()
            away = np.linalg.norm(self._target.points() - goals[i], axis=1)
            taking = self._actor.held[i] < 0 and away.argmin() == vertex and away.min() < NEARBY
            grips[i] = taking
            velocities = self._target.velocities()
            ahead = self._target.points() + self._env.control_timestep() * velocities
            center, direction = self._side_grasp(i, vertex, ahead)
            swings = np.linalg.norm(velocities[vertex]) > swinging
            far = np.linalg.norm(center - goals[i]) > 2 * STANDOFF
            if not taking and (swings or far):
                center = center + STANDOFF * direction
            if goals[i, 2] > center[2] + 2 * STANDOFF:
                center[1] = goals[other, 1] + side * OUTSIDE
            goals[i], goals[other, 2] = center, lift
            ways = np.clip((goals - self._actor.positions()) / self._stride, -1.0, 1.0)
            yield np.column_stack([ways, np.where(grips, 1.0, -1.0)]).ravel()

    def _toss(self, anew: np.ndarray) -> Iterator[np.ndarray]:
        """Tosses the cloth; grippers take what they hold from outside while it flies.

        Args:
            anew: which grippers (2,) bool let go.
        """
        targets, stride, step = self._actor.held.copy(), self._stride, self._env.control_timestep()
        for _ in range(THROW):
            yield np.tile([0.0, 0.0, 1.0, 1.0], 2)
        y = self._env.task.cloth.flat()[targets, 1]
        outside = np.zeros((2, 3))
        outside[:, 1], outside[:, 2] = np.sign(y) * math.cos(FROM_ABOVE), math.sin(FROM_ABOVE)
        closed = ~anew
        for n in range(FLIGHT):
            points, centers = self._target.points(), self._actor.positions()
            away = np.linalg.norm(points - centers[:, None], axis=2)
            nearest = (away.argmin(axis=1) == targets) & (away.min(axis=1) < NEARBY)
            closed |= nearest & (n > 0)
            ways = self._target.velocities()[targets] * step
            ways[:, 2] -= GRAVITY * step**2 / 2
            ways[~anew, :2] = 0.0
            ways[anew] += (points[targets] + REACH * outside - centers)[anew]
            ways = np.clip(ways / stride, -1.0, 1.0)
            yield np.column_stack([ways, np.where(closed, 1.0, -1.0)]).ravel()
            if (self._actor.held == targets).all():
                return

    def _side_grasp(self, i: int, vertex: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How gripper `i` takes a vertex at `points` (n, 3) [m]: center (3,) [m], direction (3,).

        Clear of other vertices and near.
        """
        side = np.sign(self._env.task.cloth.flat()[vertex, 1])
        directions = _DIRECTIONS * [1.0, side, 1.0]
        centers = np.clip(points[vertex] + REACH * directions, *self._actor.limits)
        away = np.linalg.norm(centers[:, None] - points, axis=2)
        own = away[:, vertex].copy()
        away[:, vertex] = np.inf
        clear = np.minimum(away.min(axis=1) - own, CLEAR)
        ways = np.linalg.norm(centers - self._actor.positions()[i], axis=1)
        best = int(np.argmax(clear - DETOUR * ways))
        return centers[best], directions[best]
