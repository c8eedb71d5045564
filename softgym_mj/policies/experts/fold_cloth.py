"""The expert of FoldCloth: takes the corners of column 0 and swings them over to their mirrors."""

import math
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.cloth_expert import TRAVEL_HEIGHT, ClothExpert
from softgym_mj.policies.experts.picker_expert import ARRIVED, CLOSED, OPEN, PASSED

ARC = 12  # Points of the half circle in which the corners are carried.
# [m] By which the corners are let down early, as the bend takes up as much, and the height above
# the lower layer where they are let go: lower, they push it along. Fingers that open do so as well.
SHORT, LANDING = 0.04, 0.03
ARM_SHORT, ARM_LANDING = 0.05, 0.025
SPEED = 0.25  # Fraction of full speed.


class FoldCloth(ClothExpert):
    """Takes two corners, carries them over in a half circle and lays them down."""

    def _episode(self) -> Iterator[np.ndarray]:
        cloth, grips = self._env.task.cloth, [False, False]
        wanted, mirrors = self._pairs()
        yield from self._take(dict(enumerate(wanted)), grips)
        ends = cloth.points()[mirrors]
        ways = ends - cloth.points()[wanted]
        short, landing = (ARM_SHORT, ARM_LANDING) if self._has_arms else (SHORT, LANDING)
        ends -= short * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        yield from self._swing(ends + [0.0, 0.0, landing])

    def _pairs(self) -> tuple[list[int], list[int]]:
        """The vertices that each gripper takes, and their mirrors.

        They are the corners of column 0, or as near to these as the gripper reaches both.
        """
        cloth, wanted, mirrors = self._env.task.cloth, [], []
        rows, columns = cloth.shape
        vertices = np.arange(rows * columns).reshape(rows, columns)
        half = slice(0, columns // 2)
        upper, lower = vertices[:, half].ravel(), vertices[:, ::-1][:, half].ravel()
        flat = cloth.flat()
        for i, corner in enumerate(self._matched(cloth.corners[:2].tolist())):
            order = np.argsort(np.linalg.norm(flat[upper] - flat[corner], axis=1), kind="stable")
            pairs = list(zip(upper[order].tolist(), lower[order].tolist(), strict=True))
            reached = (pair for pair in pairs if all(self._can_reach(i, v) for v in pair))
            vertex, mirror = next(reached, pairs[0])
            wanted.append(vertex)
            mirrors.append(mirror)
        return wanted, mirrors

    def _swing(self, ends: np.ndarray) -> Iterator[np.ndarray]:
        """Carries what both pickers hold to `ends` (2, 3) [m] in half a circle and lets go."""
        start = self._actor.positions()
        ends = ends - (self._target.points()[self._actor.held] - start)
        middle, half = (start + ends) / 2, (ends - start) / 2
        for angle in np.linspace(0.0, np.pi, ARC)[1:]:
            goals = middle - math.cos(angle) * half
            goals[:, 2] += math.sin(angle) * np.linalg.norm(half[:, :2], axis=1)
            last = angle == np.pi
            yield from self._move(goals, CLOSED, SPEED, near=ARRIVED if last else PASSED / 2)
        yield self._rest(OPEN)
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN, SPEED)
