"""`ArmActor`: base of the actors with robot arms."""

import numpy as np

from softgym_mj.robots.arm.action import ArmAction
from softgym_mj.robots.arm.cartesian import CartesianController
from softgym_mj.robots.arm.command_filter import CommandFilter
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.base import BodyActor


class ArmActor(BodyActor):
    """Robot arms whose joints follow a filtered command.

    A subclass's `_build` sets `_mjcf_root`, the attributes and `_filtered_command`.

    Attributes:
        arm: kind of arm.
        servos: joint servos.
    """

    hides_view = True
    ends_states = True

    arm: Arm
    servos: JointServos
    _filtered_command: CommandFilter | ArmAction

    @property
    def controller(self) -> CartesianController:
        """Controller whose reference the joints follow."""
        return self.servos.controller

    def after_compile(self, physics, random_state):
        self.servos.bind(physics.model.ptr, physics.data.ptr, self._mjcf_root.model)

    def move(self, fraction: float, timestep: float) -> None:
        self.servos.move(fraction)

    def proprioception(self) -> np.ndarray:
        """Returns the arms' own state (n (8 + 2 joints),): see `JointServos.sensed`."""
        return self.servos.sensed()

    @property
    def senses(self) -> dict[str, int]:
        return self.servos.senses

    def diagnostics(self) -> dict[str, float | int]:
        return {**super().diagnostics(), "ik_failures": self.controller.failures}

    def get_state(self) -> dict[str, np.ndarray]:
        return {
            **super().get_state(),
            **self._filtered_command.get_state(),
            **self.servos.get_state(),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        super().set_state(state)  # type: ignore[safe-super]  # The other base class defines it.
        self._filtered_command.set_state(state)
        self.servos.set_state(state)
