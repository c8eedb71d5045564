"""Arms as data: names in their MJCF models, and parameters for actors."""

import dataclasses
import math

from softgym_mj import assets


@dataclasses.dataclass(frozen=True)
class Arm:
    """Arm with a two-finger gripper.

    Names are those in the MJCF model; they get a prefix when the model is attached to a scene.

    Attributes:
        name: key in `ARMS`, and name of the MJCF model.
        xml_path: the MJCF model. It has a keyframe "home" with the fingers open, which is removed
            when the model joins a scene with more coordinates, and a camera "wrist" on the hand.
        joints: joints from the base to the hand; their actuators have the same names.
        wrist_joint: first joint of the wrist, whose links keep clear of the floor and of other
            arms.
        finger_joints: the two slides; equal positions are symmetric, 0 is closed.
        tcp_site: the point between the pads; its z axis points out of the gripper, and the fingers
            close along its y axis.
        pad_geoms: box of each pad, in the order of the finger joints; sites of the same names are
            in the middle of their inner faces.
        home: joint angles (joints,) [rad]; the gripper points straight down.
        home_cup: joint angles (joints,) [rad]; the gripper points ahead, and its fingers close on
            an upright plate.
        velocity_limits: largest joint speeds (joints,) [rad/s], which MJCF cannot express.
        torque_limits: largest joint torques (joints,) [N m], the force limits of the actuators.
        finger_range: position of a finger when closed and when open [m].
        finger_commands: position command of a finger that closes with full grip force, and of one
            that opens [m].
        pad_reach: distance from the TCP to the far end of the pads along the TCP's z axis [m].
        distance: distance of the base from the middle for cloth and rope [m].
        reach: `inner` and `outer` of its `Mount` [m].
        standoff: distance of the base from the line of a cup's handle [m].
        menagerie: name of the arm in MuJoCo Menagerie.
    """

    name: str
    xml_path: str
    joints: tuple[str, ...]
    wrist_joint: str
    finger_joints: tuple[str, str]
    home: tuple[float, ...]
    home_cup: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    torque_limits: tuple[float, ...]
    finger_range: tuple[float, float]
    finger_commands: tuple[float, float]
    pad_reach: float
    distance: float
    reach: tuple[float, float]
    standoff: float
    menagerie: str
    tcp_site: str = "tcp"
    pad_geoms: tuple[str, str] = ("left_pad", "right_pad")


# `reach` was measured with the tool down, up to 80 degrees to a side: a Franka gets to within 1 mm
# up to 0.8 m from its axis at heights of 0.02 to 0.2 m, 0.72 m at 0.45 m; a Sawyer up to 0.9 m, 0.8
# m; a UR5e up to 0.9 m, 0.76 m. Points nearer than 0.25 m obstruct the elbow, which jumps in a
# Franka. From a `distance` of 0.7 m, all four corners of flat cloths are in reach in more than nine
# of ten variations. With a `standoff` of 0.55 m, a Franka at the middle of the path of a cup
# follows the experts' paths within 4 mm for 1.2 m, 22 mm in a pour; a Sawyer within 1 mm. (From 0.4
# m, or 0.15 m higher up, a Franka is up to 75 mm off.)

# Franka Emika Panda with the Franka Hand.
FRANKA = Arm(
    name="franka",
    xml_path=assets.path("franka", "franka.xml"),
    joints=tuple(f"joint{i}" for i in range(1, 8)),
    wrist_joint="joint4",
    finger_joints=("finger_joint1", "finger_joint2"),
    # Menagerie's keyframe: elbow up, TCP at (0.554, 0, 0.521).
    home=(0.0, 0.0, 0.0, -1.5708, 0.0, 1.5708, -0.7853),
    home_cup=(0.0, 0.0, 0.0, -1.9, 0.0, 3.4, 0.8),
    # mani_skill, pybullet_data and robosuite agree.
    velocity_limits=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
    # mani_skill, pybullet_data, robosuite's URDF and Menagerie agree.
    torque_limits=(87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0),
    finger_range=(0.0, 0.04),  # All sources.
    finger_commands=(-0.01, 0.04),  # kp 2000 N/m times 10 mm is the grip force.
    pad_reach=0.00925,  # Half of an 18.5 mm pad, as in mani_skill, centered at the TCP.
    distance=0.7,
    reach=(0.28, 0.78),
    standoff=0.55,
    menagerie="franka_emika_panda",
)

# Rethink Robotics Sawyer with the Rethink electric gripper.
SAWYER = Arm(
    name="sawyer",
    xml_path=assets.path("sawyer", "sawyer.xml"),
    joints=tuple(f"right_j{i}" for i in range(7)),
    wrist_joint="right_j3",
    finger_joints=("left_finger_joint", "right_finger_joint"),
    # "neutral" in Rethink's named_poses.yaml, as in Menagerie: TCP at (0.450, 0.160, 0.107).
    home=(0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161),
    home_cup=(0.0, -1.0, 0.0, 1.8, 0.0, -0.8, 1.57),
    # Rethink's URDF.
    velocity_limits=(1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545),
    # Rethink's URDF, robosuite and Menagerie agree.
    torque_limits=(80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0),
    # Rethink's xacro; closed is 0 in the innermost slot of the fingers, where the pads meet.
    finger_range=(0.0, 0.020833),
    finger_commands=(-0.01, 0.020833),  # kp 2000 N/m times 10 mm is the grip force.
    # Half of a 33 mm pad, less what the TCP (0.109 m from the hand, as in robosuite) is beyond its
    # middle (0.1065 m).
    pad_reach=0.014,
    distance=0.7,
    reach=(0.25, 0.85),
    standoff=0.55,
    menagerie="rethink_robotics_sawyer",
)

# Universal Robots UR5e with a gripper of the size of a Robotiq 2F-85.
UR5E = Arm(
    name="ur5e",
    xml_path=assets.path("ur5e", "ur5e.xml"),
    joints=(
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ),
    wrist_joint="elbow_joint",
    finger_joints=("left_finger_joint", "right_finger_joint"),
    # Menagerie's keyframe, but for the turn of its base: elbow up, TCP at (0.492, 0.133, 0.346).
    home=(0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0),
    home_cup=(0.0, -1.54, 2.04, -0.5, 1.5708, -1.5708),
    # Universal Robots' ROS 2 description: 180 degrees/s.
    velocity_limits=(math.pi,) * 6,
    # Universal Robots' ROS 2 description and Menagerie agree.
    torque_limits=(150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
    finger_range=(0.0, 0.0425),  # Robotiq: a stroke of 85 mm.
    finger_commands=(-0.01, 0.0425),  # kp 2000 N/m times 10 mm is the grip force.
    pad_reach=0.01875,  # Half of a 37.5 mm pad, as in Menagerie, centered at the TCP.
    distance=0.7,
    reach=(0.25, 0.8),
    standoff=0.6,
    menagerie="universal_robots_ur5e",
)

ARMS = {arm.name: arm for arm in (FRANKA, SAWYER, UR5E)}
