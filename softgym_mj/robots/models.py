"""The arms as data: the names in their MJCF models, and what a controller must know of them."""

import dataclasses

from softgym_mj import assets


@dataclasses.dataclass(frozen=True)
class Arm:
    """An arm with seven joints and a gripper with two fingers.

    Names are those in the MJCF model; they get a prefix where the model is attached to a scene.

    Attributes:
        name: key in `ARMS`, and name of the MJCF model.
        xml_path: the MJCF model. It has a keyframe "home" with the fingers open, to be removed
            where the model joins a scene, which has more coordinates, and a camera "wrist" on the
            hand.
        joints: the seven joints, from the base to the hand; their actuators have their names.
        finger_joints: the two slides; equal positions are symmetric, 0 is closed.
        tcp_site: the point between the pads; its z axis points out of the gripper, and the fingers
            close along its y axis.
        pad_sites: middle of the inner face of each pad, in the order of the finger joints.
        pad_geoms: box of each pad.
        home: joint angles (7,) [rad]; the gripper points straight down.
        velocity_limits: largest joint speeds (7,) [rad/s]. MJCF cannot express these.
        torque_limits: largest joint torques (7,) [N m], the force limits of the actuators.
        finger_range: position of a finger when closed and when open [m].
        finger_commands: position command to a finger that closes with the whole grip force, and the
            one that opens [m].
        grip_force: what each finger presses with at most [N].
        pad_reach: from the TCP to the far end of the pads along the TCP's z axis [m].
        shoulder_height: of the second joint's axis above the mounting plane z = 0 [m].
        menagerie: name of the arm in MuJoCo Menagerie.
    """

    name: str
    xml_path: str
    joints: tuple[str, ...]
    finger_joints: tuple[str, str]
    home: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    torque_limits: tuple[float, ...]
    finger_range: tuple[float, float]
    finger_commands: tuple[float, float]
    grip_force: float
    pad_reach: float
    shoulder_height: float
    menagerie: str
    tcp_site: str = "tcp"
    pad_sites: tuple[str, str] = ("left_pad", "right_pad")
    pad_geoms: tuple[str, str] = ("left_pad", "right_pad")

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names (9,) of the position actuators: of the arm, then of the fingers."""
        return (*self.joints, *self.finger_joints)

    @property
    def opening(self) -> tuple[float, float]:
        """Distance [m] between the pads when closed and when open."""
        closed, open_ = self.finger_range
        return 2 * closed, 2 * open_


# Franka Emika Panda with the Franka Hand.
FRANKA = Arm(
    name="franka",
    xml_path=assets.path("franka", "franka.xml"),
    joints=tuple(f"joint{i}" for i in range(1, 8)),
    finger_joints=("finger_joint1", "finger_joint2"),
    # Menagerie's keyframe: elbow up, TCP at (0.554, 0, 0.521).
    home=(0.0, 0.0, 0.0, -1.5708, 0.0, 1.5708, -0.7853),
    # mani_skill, pybullet_data and robosuite agree.
    velocity_limits=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
    # mani_skill, pybullet_data, robosuite's URDF and Menagerie agree.
    torque_limits=(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    finger_range=(0.0, 0.04),  # All sources.
    finger_commands=(-0.01, 0.04),  # kp 2000 N/m times 10 mm is the grip force.
    grip_force=20.0,  # pybullet_data and robosuite; the hand can do more than cloth needs.
    pad_reach=0.00925,  # Half of an 18.5 mm pad, as in mani_skill, centred at the TCP.
    shoulder_height=0.333,  # All sources.
    menagerie="franka_emika_panda",
)

# Rethink Robotics Sawyer with the Rethink electric gripper.
SAWYER = Arm(
    name="sawyer",
    xml_path=assets.path("sawyer", "sawyer.xml"),
    joints=tuple(f"right_j{i}" for i in range(7)),
    finger_joints=("left_finger_joint", "right_finger_joint"),
    # "neutral" in Rethink's named_poses.yaml, as in Menagerie: TCP at (0.450, 0.160, 0.107).
    home=(0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161),
    # Rethink's URDF.
    velocity_limits=(1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545),
    # Rethink's URDF, robosuite and Menagerie agree.
    torque_limits=(80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0),
    # Rethink's xacro; closed is 0 in the innermost slot of the fingers, where the pads meet.
    finger_range=(0.0, 0.020833),
    finger_commands=(-0.01, 0.020833),  # kp 2000 N/m times 10 mm is the grip force.
    grip_force=20.0,  # Rethink's xacro and robosuite.
    # Half of a 33 mm pad, less what the TCP (0.109 m from the hand, as in robosuite) is beyond its
    # middle (0.1065 m).
    pad_reach=0.014,
    shoulder_height=0.317,  # 0.08 + 0.237, all sources.
    menagerie="rethink_robotics_sawyer",
)

ARMS = {arm.name: arm for arm in (FRANKA, SAWYER)}
