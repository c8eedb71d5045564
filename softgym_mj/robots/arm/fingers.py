"""`Fingers`: the fingers of arms in a compiled scene."""

from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.entities.flex import GRIPPER_CONTACT
from softgym_mj.native.arithmetic import squares
from softgym_mj.robots.arm.models import Arm

OUT_OF_THE_WAY = 0.07  # [m] Distance from the tool point beyond the pads of the widest hand.


class Fingers:
    """Fingers of n arms in a compiled scene.

    Attributes:
        arm: kind of arm.
        model, data: the scene.
        positions_at, speeds_at: addresses (n, 2) of their joints in qpos and qvel.
        motors: their actuators (n, 2).
        pads: geoms (n, 2) of their pads.
    """

    def __init__(
        self, arm: Arm, model: mujoco.MjModel, data: mujoco.MjData, prefixes: Sequence[str]
    ):
        """Finds the fingers in a scene, by the name prefixes (n,) of each arm's elements."""

        def ids(find, elements):
            return np.array([[find(f"{p}/{element}").id for element in elements] for p in prefixes])

        self.arm, self.model, self.data = arm, model, data
        joints = ids(model.joint, arm.finger_joints)
        self.positions_at, self.speeds_at = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self.motors = ids(model.actuator, arm.finger_joints)
        self.pads = ids(model.geom, arm.pad_geoms)

    @property
    def openings(self) -> np.ndarray:
        """Distances (n,) [m] of the pads of each hand."""
        return self.data.qpos[self.positions_at].sum(axis=1)

    def open(self) -> None:
        """Opens all fingers, at rest."""
        self.data.qpos[self.positions_at] = self.arm.finger_range[1]
        self.data.qvel[self.speeds_at] = 0.0
        self.data.ctrl[self.motors] = self.arm.finger_commands[1]

    def put(self, i: int, position: float, command: float) -> None:
        """Puts the fingers of arm `i` at `position` [m], commanded to `command` [m]."""
        self.data.qpos[self.positions_at[i]] = position
        self.data.ctrl[self.motors[i]] = command

    def clear(self, i: int, offsets: np.ndarray) -> bool:
        """Returns whether the fingers of arm `i` are open and clear of vertices.

        Args:
            i: index of the arm.
            offsets: vertices relative to the tool point (n, 3) [m].
        """
        opened = self.data.qpos[self.positions_at[i]].min() > sum(self.arm.finger_range) / 2
        return bool(opened and squares(offsets).min() > OUT_OF_THE_WAY**2)

    def set_solid(self, i: int, solid: bool) -> None:
        """Makes the pads of arm `i` push the object, or pass through it."""
        self.model.geom_contype[self.pads[i]] = GRIPPER_CONTACT if solid else 0
