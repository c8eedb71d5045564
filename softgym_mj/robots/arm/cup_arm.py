"""`CupArm`: a robot arm that holds a cup by its handle and moves it as a `CupMover` does."""

import math

import mujoco
import numpy as np
from dm_control import composer, mjcf

from softgym_mj.entities.cup import GRIP
from softgym_mj.native.arithmetic import product
from softgym_mj.robots.arm import bodies as arm_bodies
from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm.actor import ArmActor
from softgym_mj.robots.arm.cartesian import LEAD
from softgym_mj.robots.arm.command_filter import CommandFilter, clipped
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount
from softgym_mj.robots.cup_mover import CupMover, CupTool

ORIENTATION_COST = 0.3  # [1/rad] A radian costs as much as 0.3 m, because tilt pours.
# [m/rad] Length by which rotations are converted to distances where a speed or a lead is limited:
# about the size of the cup.
TURNS_AS = np.array([1.0, 1.0, 0.3])
HALF_HANDLE = 0.01  # [m] Position of each finger on the handle.


def turned(theta: float) -> np.ndarray:
    """Returns a rotation matrix (3, 3) about +Y by an angle [rad]."""
    cosine, sine = math.cos(theta), math.sin(theta)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


# Axes of the tool that holds an upright cup, as columns: it points along -Y and closes along X.
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
ORIENTED = turns.signed(UPRIGHT)[None]  # The same as a quaternion (1, 4).


class CupArm(ArmActor, CupMover):
    """Arm at the far side of the cup's path, with the cup's handle in its hand.

    The action is that of `CupMover`. The cup is fixed to the hand, which follows the commanded pose
    as fast as its joints can; the command waits if the hand falls behind or cannot reach it. The
    handle is beside the cup, so dtheta rotates the wrist about the pointing direction of the hand.
    Water pushes the cup, hence the joints. The arm does not collide.

    Attributes:
        mount: base of the arm.
    """

    mount: Mount
    _filtered_command: CommandFilter

    def __init__(self, arm: Arm, tool: CupTool, visual: str = "primitive"):
        """Builds the arm around a cup.

        Args:
            arm: kind of arm.
            tool: the cup, and limits of its motion.
            visual: as in `arm_bodies.add_arms`.
        """
        CupMover.__init__(self, tool)
        composer.Entity.__init__(self, arm, tool.base_x, visual)

    def _build(self, arm: Arm, base_x: float, visual: str):
        self.arm, self.name, self.wrists = arm, f"{arm.name}/cup", arm_bodies.wrists(1)
        self._mjcf_root = mjcf.RootElement(model="arms")
        self.mount = Mount((base_x, GRIP[1] + arm.standoff, 0.0), -math.pi / 2, *arm.reach)
        arm_bodies.add_arms(self._mjcf_root, arm, [self.mount], visual=visual)
        home = np.array(arm.home_cup)
        self.servos = JointServos(
            arm, [self.mount], home, orientation_cost=ORIENTATION_COST, oriented=ORIENTED
        )
        # Entries are clipped separately, so that a lag along X causes no lift or rotation.
        self._filtered_command = CommandFilter(1, clipped)
        (name,) = arm_bodies.names(arm, 1)
        tcp = self._mjcf_root.find("site", f"{name}/{arm.tcp_site}")
        site = tcp.parent.add("site", name="grip", pos=tcp.pos, quat=_grip_quaternion(tcp))
        self.cup.join_hand(self, site)

    @property
    def commanded_pose(self) -> np.ndarray:
        return self._filtered_command.commanded[0] / TURNS_AS

    @property
    def reference_pose(self) -> np.ndarray:
        """Pose (3,) of the cup in the hand of the controller's reference."""
        (point,), (rotation,) = self.controller.points(), self.controller.rotations()
        turn = product(rotation, UPRIGHT.T)
        theta = math.atan2(turn[0, 2], turn[0, 0])
        x, _, z = point - product(turned(theta), np.array(GRIP))
        return np.array([x, z, theta])

    def place(self, pose: np.ndarray) -> None:
        self._rejected = 0
        self._aim(pose)
        self.controller.reset(self._tool(pose)[None])
        self._filtered_command.start((pose * TURNS_AS)[None])
        self.servos.reset()
        self.servos.fingers.put(0, HALF_HANDLE, HALF_HANDLE)

    def _tool(self, pose: np.ndarray) -> np.ndarray:
        """Returns the tool point (3,) [m] for a pose of the cup."""
        return np.array([pose[0], 0.0, pose[1]]) + product(turned(pose[2]), np.array(GRIP))

    def _aim(self, pose: np.ndarray) -> None:
        self.controller.turn(product(turned(pose[2]), UPRIGHT)[None])

    def remembered(self) -> np.ndarray:
        """Returns the commanded pose (3,): x [m], z [m], theta [rad]; joints imply the velocity."""
        return self.commanded_pose

    @property
    def remembers(self) -> dict[str, int]:
        return {"commanded x, z [m]": 2, "commanded theta [rad]": 1}

    def plan(self) -> None:
        self._filtered_command.advance((self._wanted() * TURNS_AS)[None], self._within_lead)
        self.servos.plan(self._follow)

    def _within_lead(self, points: np.ndarray) -> np.ndarray:
        return clipped(points, (self.reference_pose * TURNS_AS)[None], LEAD)

    def _follow(self, steps: int) -> None:
        # The filter is extrapolated to the controller's next solution.
        pose = (self._filtered_command.points + steps * self._filtered_command.step)[0] / TURNS_AS
        self._aim(pose)
        self.controller.follow_points(self._tool(pose)[None])


def _grip_quaternion(tool: mjcf.Element) -> np.ndarray:
    """Returns the orientation (4,) in the tool's frame of a site with the axes of the held cup."""
    own = np.array([1.0, 0.0, 0.0, 0.0] if tool.quat is None else tool.quat)
    back, result = np.empty(4), np.empty(4)
    mujoco.mju_mat2Quat(back, UPRIGHT.T.ravel())
    mujoco.mju_mulQuat(result, own, back)
    return result
