"""`PositionAction`: commanded displacements of hands that point down, as for pickers."""

import functools

import numpy as np

from softgym_mj.robots.arm.action import ArmAction, Clip
from softgym_mj.robots.arm.command_filter import CommandFilter
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.base import ActionSpace
from softgym_mj.robots.gripper import DISPLACEMENTS, MAX_DISPLACEMENT, gripper_actions


class PositionAction(ArmAction):
    """Displacement (dx, dy, dz) of the commanded tool point along the world's axes, and grip.

    A commanded point waits if the arm falls behind.
    """

    name = "position"

    def __init__(self, servos: JointServos, clip: Clip):
        super().__init__(servos, clip)
        self._filter = CommandFilter(servos.number)

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
        self._controller.follow(self._filter.points + steps * self._filter.step)

    @property
    def commanded(self) -> np.ndarray:
        return self._filter.commanded.copy()

    @property
    def leading(self) -> np.ndarray:
        return self._filter.points.copy()

    def remembered(self) -> np.ndarray:
        return self._filter.commanded.ravel()

    @property
    def remembers(self) -> dict[str, int]:
        number = self._servos.number
        return {f"arm {i}, commanded (x, y, z) [m]": 3 for i in range(number)}

    def get_state(self) -> dict[str, np.ndarray]:
        return self._filter.get_state()

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._filter.set_state(state)
