"""`RegraspingExpert`: regrasps cloth that hangs from both grippers at other vertices."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from softgym_mj.policies.experts.cloth_expert import ClothExpert
from softgym_mj.policies.experts.picker_expert import CLOSED

REACH = 0.055  # [m] Grasp distance, at which pickers touch the vertex.
NEARBY = 0.075  # [m] Distance within which a closing picker grasps the vertex nearest to it.
CLEAR = 0.02  # [m] Desired extra distance of the next vertex.
STANDOFF = 0.06  # [m] Extra distance at which a gripper waits for a swinging vertex.
OUTSIDE = 0.25  # [m] Distance at which a gripper passes the hanging cloth on its way down.
ROOM = 0.1  # [m] Distance of the lowest grippers to a vertex that is grasped from the side.
DETOUR = 0.1  # [m] Clearance that is worth a detour of 1 m.
GRAVITY = 9.81  # [m/s^2]
THROW = 3  # Env steps at full speed upwards before the release.
FLIGHT = 6  # Env steps of flight until the regrasp.
FROM_ABOVE = math.radians(10.0)  # Elevation of a gripper that grasps a vertex from outside.


def _directions() -> np.ndarray:
    """Returns unit vectors (n, 3) every 15 degrees around +Y, beside a sheet that spans along Y."""
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
    """Regrasps hanging cloth with one gripper at a time while the other one holds it."""

    def _regrasp(
        self, targets: list[int], order: Sequence[int], swinging: float, latest: int
    ) -> Iterator[np.ndarray]:
        """Grasps a vertex with each gripper; gives up after `latest` env steps of the episode.

        Args:
            targets: The vertices.
            order: Order of the grippers.
            swinging: Speed of a vertex [m/s] above which the gripper waits for it.
            latest: Last env step.
        """
        for i in order:
            if self._actor.held[i] != targets[i]:
                yield from self._fetch(i, targets[i], swinging, latest)

    def _fetch(self, i: int, vertex: int, swinging: float, latest: int) -> Iterator[np.ndarray]:
        """Opens gripper `i` and grasps a vertex as soon as it is the nearest one."""
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
        """Tosses the cloth; grippers regrasp their vertices from outside while it flies.

        Args:
            anew: Which grippers (2,) bool release and regrasp.
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
        """Returns center (3,) [m] and direction (3,) of a grasp of a vertex at `points` (n, 3) [m].

        They are clear of other vertices and near gripper `i`.
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
