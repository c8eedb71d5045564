"""`JointAction`: commanded joint velocities, without inverse kinematics."""

import functools

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm import cartesian
from softgym_mj.robots.arm.action import ArmAction, Clip
from softgym_mj.robots.arm.command_filter import drawn_in
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.base import SIM_STEP, ActionSpace
from softgym_mj.robots.gripper import gripper_actions

# [m/s] Speed to which the largest speed of a joint corresponds where leads and accelerations are
# limited: it is reached in 0.15 s. A Franka's joints then accelerate at 14 to 17 rad/s^2.
FASTEST_AS = 1.5


class JointAction(ArmAction):
    """Action space of arms: a fraction of each joint's maximum velocity, and a grip per hand.

    Commanded joints stay within their limits and stop while the arm lags too far behind. Workspace
    and reach do not bound the hands; they keep clear of the floor and of each other.
    """

    name = "joints"
    displaces = False

    def __init__(self, servos: JointServos, clip: Clip):
        super().__init__(servos, clip, len(servos.velocity_limits))
        self._largest = servos.velocity_limits * SIM_STEP  # [rad] Largest rotation in a sim step.
        self._scale = (FASTEST_AS / servos.velocity_limits)[:, None]  # [m/rad]

    @functools.cached_property
    def actions(self) -> ActionSpace:
        names, number = self._servos.joints, self._servos.number
        moves = tuple(
            (f"change of {name}", "rad", f"-{largest:.4g} to {largest:.4g} per sim step")
            for name, largest in zip(names, self._largest[: len(names)], strict=True)
        )
        return gripper_actions(number, moves)

    def start(self, points: np.ndarray) -> None:
        self._controller.reset(points)
        self._filter.start(self._scaled(self._controller.configuration))

    def displacing(self, fractions: np.ndarray, grips: np.ndarray) -> np.ndarray:
        raise InvalidArgumentError("action", self.name, "an action that commands hand positions")

    def advance(self) -> None:
        wanted = self.angles + self._largest * self._entries.ravel()
        within = np.clip(wanted, *self._controller.range)
        self._filter.advance(self._scaled(within), self._within_lead)

    def follow(self, steps: int) -> None:
        # The filter is extrapolated to the controller's next solution.
        self._controller.follow_joints(
            self._unscaled(self._filter.points + steps * self._filter.step)
        )

    @property
    def angles(self) -> np.ndarray:
        """Commanded joint angles (n joints,) [rad], a fresh array."""
        return self._unscaled(self._filter.commanded)

    def _scaled(self, angles: np.ndarray) -> np.ndarray:
        return angles[:, None] * self._scale

    def _unscaled(self, points: np.ndarray) -> np.ndarray:
        return (points / self._scale)[:, 0]

    def _within_lead(self, points: np.ndarray) -> np.ndarray:
        reference = self._scaled(self._controller.configuration)
        return drawn_in(points, reference, cartesian.LEAD)

    @property
    def commanded(self) -> np.ndarray:
        return self._servos.points_at(self.angles)

    def remembered(self) -> np.ndarray:
        return self.angles

    @property
    def remembers(self) -> dict[str, int]:
        number, joints = self._servos.number, len(self._servos.joints)
        return {f"arm {i}, commanded joint positions [rad]": joints for i in range(number)}
