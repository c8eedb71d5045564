"""`PositionAction`: commanded displacements of hands that point down, as for pickers."""

import functools

import numpy as np

from softgym_mj.robots.arm.action import ArmAction
from softgym_mj.robots.base import ActionSpace
from softgym_mj.robots.gripper import DISPLACEMENTS, MAX_DISPLACEMENT, gripper_actions


class PositionAction(ArmAction):
    """Displacement (dx, dy, dz) of the commanded tool point along the world's axes, and grip.

    A commanded point waits if the arm falls behind.
    """

    name = "position"

    @functools.cached_property
    def actions(self) -> ActionSpace:
        return gripper_actions(self._servos.number, DISPLACEMENTS)

    def start(self, points: np.ndarray) -> None:
        self._controller.reset(points)
        self._filter.start(self._controller.within_lead(points))

    def displacing(self, fractions: np.ndarray, grips: np.ndarray) -> np.ndarray:
        return np.column_stack([fractions, np.where(grips, 1.0, -1.0)]).ravel()

    def advance(self) -> None:
        way = MAX_DISPLACEMENT * self._entries[:, :3]
        wanted = self._clip(self._filter.commanded + way)
        self._filter.advance(wanted, self._controller.within_lead)

    def follow(self, steps: int) -> None:
        # The filter is extrapolated to the controller's next solution.
        self._controller.follow_points(self._filter.points + steps * self._filter.step)

    @property
    def commanded(self) -> np.ndarray:
        return self._filter.commanded.copy()

    def remembered(self) -> np.ndarray:
        return self._filter.commanded.ravel()

    @property
    def remembers(self) -> dict[str, int]:
        number = self._servos.number
        return {f"arm {i}, commanded (x, y, z) [m]": 3 for i in range(number)}
