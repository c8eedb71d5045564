"""Expert of FoldCloth: grasps the corners of column 0 and carries them to their mirror images.

Hands that rotate (`action="pose"`) lean over the edge that they carry, from its outer side at both
ends of the fold. Near the floor they lean only as far as their open fingers have room.
"""

import math
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.cloth_expert import TRAVEL_HEIGHT, ClothExpert
from softgym_mj.policies.experts.picker_expert import ARRIVED, CLOSED, OPEN, PASSED
from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm.pose_action import MAX_TURN

ARC = 12  # Points of the half circle in which the corners are carried.
# [m] Distance before the mirror image at which corners are lowered, as the bend takes up length,
# and release height above the lower layer: lower corners, or opening fingers, push it along.
SHORT, LANDING = 0.04, 0.03
ARM_SHORT, ARM_LANDING = 0.05, 0.025
SPEED = 0.25  # Fraction of full speed.
TILT = math.radians(40.0)  # Angle of hands to the vertical at grasp and release.
HALF_SPAN = 0.05  # [m] Distance from the tool point to the outer side of an open finger.


class FoldCloth(ClothExpert):
    """Grasps two corners and carries them in a half circle to their mirror images."""

    def _begin(self):
        super()._begin()
        self._leaning = np.zeros((2, 3))  # [rad] Rotation vectors of the hands from straight down.
        self._down: np.ndarray | None = None  # Their orientations (2, 4) there.

    def _step(self, goals, grips, speed=1.0):
        action = super()._step(goals, grips, speed)
        if not self._actor.turns:
            return action
        commanded = self._actor.commanded_quaternions()
        if self._down is None:
            self._down = commanded
        target = turns.compose(turns.quaternions(self._leaning * self._room(goals)), self._down)
        fractions = turns.between(commanded, target) / (MAX_TURN * self._env.task.action_repeat)
        fractions /= np.maximum(np.abs(fractions).max(axis=1, keepdims=True), 1.0)
        moves = action.reshape(2, -1)
        return self._actor.posing(moves[:, :3], fractions, moves[:, -1] > 0.0)

    def _room(self, goals: np.ndarray) -> np.ndarray:
        """Returns the shares (2, 1) of `TILT` that hands can lean at tool points `goals` (2, 3)."""
        above = np.maximum(goals[:, 2:] - self._actor.limits[0][2], 0.0)
        return np.minimum(np.arcsin(np.minimum(above / HALF_SPAN, 1.0)) / TILT, 1.0)

    def _lean(self, ways: np.ndarray, share: float) -> None:
        """Makes hands lean back by a share of `TILT`, against the directions `ways` (2, 3) [m]."""
        across = np.column_stack([-ways[:, 1], ways[:, 0], np.zeros(2)])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        self._leaning = -share * TILT * across

    def _episode(self) -> Iterator[np.ndarray]:
        cloth, grips = self._env.task.cloth, [False, False]
        targets, mirrors = self._pairs()
        self._lean(cloth.points()[mirrors] - cloth.points()[targets], 1.0)
        yield from self._take(dict(enumerate(targets)), grips)
        ends = cloth.points()[mirrors]
        ways = ends - cloth.points()[targets]
        short, landing = (ARM_SHORT, ARM_LANDING) if self._has_arms else (SHORT, LANDING)
        ends -= short * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        yield from self._swing(ends + [0.0, 0.0, landing])

    def _pairs(self) -> tuple[list[int], list[int]]:
        """Returns the vertices that the grippers grasp, and their mirror images.

        They are the corners of column 0, or the nearest vertices where a gripper reaches both.
        """
        cloth, targets, mirrors = self._env.task.cloth, [], []
        vertices, half = cloth.arrays["grid"], slice(0, cloth.shape[1] // 2)
        upper, lower = vertices[:, half].ravel(), vertices[:, ::-1][:, half].ravel()
        flat = cloth.flat()
        for i, corner in enumerate(self._matched(cloth.corners[:2].tolist())):
            order = np.argsort(np.linalg.norm(flat[upper] - flat[corner], axis=1), kind="stable")
            pairs = list(zip(upper[order].tolist(), lower[order].tolist(), strict=True))
            reached = (pair for pair in pairs if all(self._can_reach(i, v) for v in pair))
            vertex, mirror = next(reached, pairs[0])
            targets.append(vertex)
            mirrors.append(mirror)
        return targets, mirrors

    def _swing(self, ends: np.ndarray) -> Iterator[np.ndarray]:
        """Carries the held vertices to `ends` (2, 3) [m] in a half circle and releases them."""
        start = self._actor.positions()
        ends = ends - (self._target.points()[self._actor.held] - start)
        middle, half = (start + ends) / 2, (ends - start) / 2
        for angle in np.linspace(0.0, np.pi, ARC)[1:]:
            goals = middle - math.cos(angle) * half
            goals[:, 2] += math.sin(angle) * np.linalg.norm(half[:, :2], axis=1)
            self._lean(half, math.cos(angle))
            last = angle == np.pi
            yield from self._move(goals, CLOSED, SPEED, near=ARRIVED if last else PASSED / 2)
        yield self._rest(OPEN)
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN, SPEED)
