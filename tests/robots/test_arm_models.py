"""The arms' MJCF models against the published tables, copied here by hand."""

import math

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softgym_mj.robots.arm.models import ARMS

HALF = math.sqrt(0.5)
UNTURNED, BACK, FORTH = (1, 0, 0, 0), (HALF, -HALF, 0, 0), (HALF, HALF, 0, 0)
ASIDE = (HALF, 0, HALF, 0)

# Frames: body -> (parent, origin [m], quaternion wxyz, joint).
FRAMES = {
    "franka": {
        "link0": ("world", (0, 0, 0), UNTURNED, None),
        "link1": ("link0", (0, 0, 0.333), UNTURNED, "joint1"),
        "link2": ("link1", (0, 0, 0), BACK, "joint2"),
        "link3": ("link2", (0, -0.316, 0), FORTH, "joint3"),
        "link4": ("link3", (0.0825, 0, 0), FORTH, "joint4"),
        "link5": ("link4", (-0.0825, 0.384, 0), BACK, "joint5"),
        "link6": ("link5", (0, 0, 0), FORTH, "joint6"),
        "link7": ("link6", (0.088, 0, 0), FORTH, "joint7"),
        # The hand is turned by -45 degrees on the flange.
        "hand": (
            "link7",
            (0, 0, 0.107),
            (math.cos(math.pi / 8), 0, 0, -math.sin(math.pi / 8)),
            None,
        ),
        "tcp": ("hand", (0, 0, 0.1034), UNTURNED, None),
    },
    "sawyer": {
        "base": ("world", (0, 0, 0), UNTURNED, None),
        "right_l0": ("base", (0, 0, 0.08), UNTURNED, "right_j0"),
        "head": ("right_l0", (0, 0, 0.2965), UNTURNED, None),
        "right_l1": ("right_l0", (0.081, 0.05, 0.237), (0.5, -0.5, 0.5, 0.5), "right_j1"),
        "right_l2": ("right_l1", (0, -0.14, 0.1425), FORTH, "right_j2"),
        "right_l3": ("right_l2", (0, -0.042, 0.26), BACK, "right_j3"),
        "right_l4": ("right_l3", (0, -0.125, -0.1265), FORTH, "right_j4"),
        "right_l5": ("right_l4", (0, 0.031, 0.275), BACK, "right_j5"),
        "right_l6": (
            "right_l5",
            (0, -0.11, 0.1053),
            (0.0616248, 0.06163, -0.704416, 0.704416),
            "right_j6",
        ),
        "right_hand": ("right_l6", (0, 0, 0.0245), (HALF, 0, 0, HALF), None),
        "tcp": ("right_hand", (0, 0, 0.109), UNTURNED, None),
    },
    "ur5e": {
        "base": ("world", (0, 0, 0), UNTURNED, None),
        "shoulder_link": ("base", (0, 0, 0.1625), UNTURNED, "shoulder_pan_joint"),
        "upper_arm_link": ("shoulder_link", (0, 0.138, 0), ASIDE, "shoulder_lift_joint"),
        "forearm_link": ("upper_arm_link", (0, -0.131, 0.425), UNTURNED, "elbow_joint"),
        "wrist_1_link": ("forearm_link", (0, 0, 0.3922), ASIDE, "wrist_1_joint"),
        "wrist_2_link": ("wrist_1_link", (0, 0.1263, 0), UNTURNED, "wrist_2_joint"),
        "wrist_3_link": ("wrist_2_link", (0, 0, 0.0997), UNTURNED, "wrist_3_joint"),
        "hand": ("wrist_3_link", (0, 0.0996, 0), BACK, None),
        "tcp": ("hand", (0, 0, 0.1415), UNTURNED, None),
    },
}
# Axes of the arm joints.
AXES = {"franka": "zzzzzzz", "sawyer": "zzzzzzz", "ur5e": "zyyyzy"}

# Joint -> (lower, upper [rad], speed [rad/s], torque [N m]).
LIMITS = {
    "franka": {
        "joint1": (-2.8973, 2.8973, 2.175, 87),
        "joint2": (-1.7628, 1.7628, 2.175, 87),
        "joint3": (-2.8973, 2.8973, 2.175, 87),
        "joint4": (-3.0718, -0.0698, 2.175, 87),
        "joint5": (-2.8973, 2.8973, 2.61, 12),
        "joint6": (-0.0175, 3.7525, 2.61, 12),
        "joint7": (-2.8973, 2.8973, 2.61, 12),
    },
    "sawyer": {
        "right_j0": (-3.0503, 3.0503, 1.74, 80),
        "right_j1": (-3.8095, 2.2736, 1.328, 80),
        "right_j2": (-3.0426, 3.0426, 1.957, 40),
        "right_j3": (-3.0439, 3.0439, 1.957, 40),
        "right_j4": (-2.9761, 2.9761, 3.485, 9),
        "right_j5": (-2.9761, 2.9761, 3.485, 9),
        "right_j6": (-4.7124, 4.7124, 4.545, 9),
    },
    "ur5e": {  # Published in degrees.
        "shoulder_pan_joint": (-6.283185307, 6.283185307, math.radians(180), 150),
        "shoulder_lift_joint": (-6.283185307, 6.283185307, math.radians(180), 150),
        "elbow_joint": (-3.141592654, 3.141592654, math.radians(180), 150),
        "wrist_1_joint": (-6.283185307, 6.283185307, math.radians(180), 28),
        "wrist_2_joint": (-6.283185307, 6.283185307, math.radians(180), 28),
        "wrist_3_joint": (-6.283185307, 6.283185307, math.radians(180), 28),
    },
}

# Body -> (mass [kg], center of mass [m], inertia xx yy zz xy xz yz [kg m2] about it in link axes).
_FINGER = (0.015, (0, 0, 0), (2.375e-6, 2.375e-6, 7.5e-7, 0, 0, 0))
# Solids of the parts' mass and size: a box of 10 x 13.5 x 80 mm, a cylinder along y.
_ROD = tuple(0.03 / 12 * (a**2 + b**2) for a, b in ((0.0135, 0.08), (0.01, 0.08), (0.01, 0.0135)))
_TIP = (0.03, (0, 0.008, 0.04), (*_ROD, 0, 0, 0))
# Driver, coupler, spring link, follower and pad of a side of the 2F-85: 9.00 + 14.10 + 22.16 +
# 12.52 + 3.50 g.
_LINKS = 0.0612794  # [kg]
_BOX = (0.022, 0.016, 0.075)  # [m]
_SIDE = tuple(_LINKS / 12 * (sum(a**2 for a in _BOX) - own**2) for own in _BOX)
_KNUCKLE = (_LINKS, (0, 0.012, 0.033), (*_SIDE, 0, 0, 0))
_ACROSS, _ALONG = 0.3 * (3 * 0.029**2 + 0.1**2) / 12, 0.3 * 0.029**2 / 2
INERTIAS = {
    "franka": {
        "link0": (0.629769, (-0.041018, -0.00014, 0.049974),
                  (0.00315, 0.00388, 0.004285, 8.2904e-07, 0.00015, 8.2299e-06)),
        "link1": (4.970684, (0.003875, 0.002081, -0.04762),
                  (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169)),
        "link2": (0.646926, (-0.003141, -0.02872, 0.003495),
                  (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704)),
        "link3": (3.228604, (0.027518, 0.039252, -0.066502),
                  (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805)),
        "link4": (3.587895, (-0.05317, 0.104419, 0.027454),
                  (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
        "link5": (1.225946, (-0.011953, 0.041065, -0.038437),
                  (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)),
        "link6": (1.666555, (0.060149, -0.014117, -0.010517),
                  (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
        "link7": (0.735522, (0.010517, -0.004252, 0.061597),
                  (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741)),
        "hand": (0.73, (-0.01, 0, 0.03), (0.001, 0.0025, 0.0017, 0, 0, 0)),
        "left_finger": _FINGER,
        "right_finger": _FINGER,
    },
    "sawyer": {
        "base": (2.0687, (-0.0006241, -2.8025e-05, 0.065404),
                 (0.0067599, 0.0067877, 0.0074031, -4.2024e-05, -6.1904e-07, 1.5888e-05)),
        "right_l0": (5.3213, (0.024366, 0.010969, 0.14363),
                     (0.053314, 0.057902, 0.023659, 0.0047093, 0.011734, 0.0080179)),
        # Published as principal moments and a rotation; turned into link axes here.
        "head": (1.5795, (0.0053207, -2.6549e-05, 0.1021),
                 (0.01183304, 0.0082709, 0.0049661, -4.467e-06, 4.9426e-05, 4.2e-07)),
        "right_l1": (4.505, (-0.0030849, -0.026811, 0.092521),
                     (0.022398, 0.014613, 0.017295, -0.00023986, -0.00029362, -0.0060875)),
        "right_l2": (1.745, (-0.00016044, -0.014967, 0.13582),
                     (0.025506, 0.0253, 0.0034179, 4.41e-06, 1.495e-05, -0.0033204)),
        "right_l3": (2.5097, (-0.0048135, -0.0281, -0.084154),
                     (0.01016, 0.0065685, 0.0069078, -9.74e-06, 0.00026625, 0.0030316)),
        "right_l4": (1.1136, (-0.0018844, 0.0069001, 0.1341),
                     (0.013557, 0.013555, 0.0013658, 1.811e-05, 0.00013523, 0.0010561)),
        "right_l5": (1.5625, (0.0061133, -0.023697, 0.076416),
                     (0.0047328, 0.0029676, 0.0031762, 0.00011526, 4.627e-05, -0.0011557)),
        "right_l6": (0.3292, (-8.0726e-06, 0.0085838, -0.0049566),
                     (0.00031105, 0.00021549, 0.00035976, 1.4771e-06, -3.7074e-07, -8.4533e-06)),
        "gripper_base": (0.3, (0, 0, 0), (_ACROSS, _ALONG, _ACROSS, 0, 0, 0)),
        "left_finger": _TIP,
        "right_finger": _TIP,
    },
    # Published in the frames of the DH parameters; turned into link axes here.
    "ur5e": {
        "base": (4.0, (0, 0, 0), (0.00443333, 0.00443333, 0.0072, 0, 0, 0)),
        "shoulder_link": (3.761, (0, 0.00193, -0.02561),
                          (0.0070021, 0.00657286, 0.00648091, 1.053e-05, -7.3e-07, 0.00049994)),
        "upper_arm_link": (8.058, (0, 0.11336 - 0.138, 0.425 - 0.2125),
                           (0.33388086, 0.33247207, 0.01505885, 1.81e-06, -5.4e-05, -5.63e-06)),
        "forearm_link": (2.846, (0, 0.0265 - 0.007, 0.3922 - 0.15),
                         (0.07879254, 0.0784851, 0.00399632, 6.6e-06, -1.365e-05, -0.00137272)),
        "wrist_1_link": (1.37, (0, 0.1263 - 0.0018, 0.01634),
                         (0.00165491, 0.00135962, 0.00126279, -2.82e-06, -4.38e-06, 0.00010157)),
        "wrist_2_link": (1.3, (0, 0.01634, 0.0997 - 0.0018),
                         (0.00135617, 0.00096614, 0.00127827, 4.44e-06, 2.74e-06, 5.048e-05)),
        "wrist_3_link": (0.365, (0, 0.0996 - 0.001159, 0),
                         (0.00018694, 0.00025756, 0.00018908, -1.7e-07, -6e-08, 9.2e-07)),
        "hand": (0.777441, (0, 0, 0.0463), (0.000260285, 0.000225381, 0.000152708, 0, 0, 0)),
        "left_finger": _KNUCKLE,
        "right_finger": _KNUCKLE,
    },
}  # fmt: skip

OPENINGS = {"franka": 0.08, "sawyer": 0.041666, "ur5e": 0.085}  # [m]
# TCP of the home pose [m].
HOMES = {
    "franka": (0.554, 0, 0.521),
    "sawyer": (0.450, 0.160, 0.107),
    "ur5e": (0.492, 0.133, 0.346),
}
# Height of the second joint's axis above the mounting plane [m]: all sources; 0.08 + 0.237, all
# sources; Universal Robots.
SHOULDERS = {"franka": 0.333, "sawyer": 0.317, "ur5e": 0.1625}
# [N] Of each finger: pybullet_data and robosuite (the Franka can do more than cloth needs);
# Rethink's xacro and robosuite; of Robotiq's 20 to 235 N.
GRIP_FORCE = 20.0


@pytest.fixture(params=list(ARMS))
def arm(request):
    return ARMS[request.param]


@pytest.fixture
def model(arm):
    return mujoco.MjModel.from_xml_path(arm.xml_path)


@pytest.fixture
def data(model):
    """At the keyframe "home"."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    return data


def turned(quaternion):
    """Rotation matrix of a quaternion, which is normalized first."""
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def transform(rotation, origin):
    """Homogeneous transform (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation, origin
    return result


def frames(arm, angles):
    """Pose (4, 4) of every frame of the table."""
    turns = {
        joint: Rotation.from_euler(axis, angle).as_matrix()
        for joint, axis, angle in zip(arm.joints, AXES[arm.name], angles, strict=True)
    }
    poses = {"world": np.eye(4)}
    for body, (parent, origin, quaternion, joint) in FRAMES[arm.name].items():
        rotation = turned(quaternion) @ turns.get(joint, np.eye(3))
        poses[body] = poses[parent] @ transform(rotation, origin)
    return poses


def lowest(model, data, geom):
    """Height [m] of the lowest point of a primitive geom."""
    height, size, kind = data.geom_xpos[geom][2], model.geom_size[geom], model.geom_type[geom]
    down = np.abs(data.geom_xmat[geom].reshape(3, 3)[2])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return height - size[0] - down[2] * size[1]
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return height - down[2] * size[1] - math.sqrt(max(0.0, 1 - down[2] ** 2)) * size[0]
    assert kind == mujoco.mjtGeom.mjGEOM_BOX
    return height - down @ size


def test_forward_kinematics_are_those_of_the_table(arm, model, data):
    addresses = [model.joint(name).qposadr[0] for name in arm.joints]
    low, high, *_ = np.array(list(LIMITS[arm.name].values())).T
    for angles in np.random.default_rng(0).uniform(low, high, (20, len(low))):
        data.qpos[addresses] = angles
        mujoco.mj_kinematics(model, data)
        for name, expected in frames(arm, angles).items():
            frame = data.site(arm.tcp_site) if name == "tcp" else data.body(name)
            np.testing.assert_allclose(frame.xpos, expected[:3, 3], atol=1e-9)
            np.testing.assert_allclose(frame.xmat.reshape(3, 3), expected[:3, :3], atol=1e-9)


def test_joints_have_the_table_s_axes_and_limits(arm, model):
    for index, (name, row) in enumerate(LIMITS[arm.name].items()):
        lower, upper, speed, torque = row
        joint, actuator = model.joint(name), model.actuator(name)
        assert arm.joints[index] == name
        np.testing.assert_array_equal(joint.axis, np.eye(3)["xyz".index(AXES[arm.name][index])])
        np.testing.assert_array_equal(joint.range, [lower, upper])
        np.testing.assert_array_equal(actuator.ctrlrange, [lower, upper])
        np.testing.assert_array_equal(actuator.forcerange, [-torque, torque])
        assert arm.velocity_limits[index] == speed
        assert arm.torque_limits[index] == torque
    assert len(LIMITS[arm.name]) == len(arm.joints) == len(arm.home)


def test_names_are_those_of_the_model(arm, model):
    names = [model.actuator(i).name for i in range(model.nu)]
    assert names == [*arm.joints, *arm.finger_joints]
    for name in names:
        assert model.actuator(name).trnid[0] == model.joint(name).id
    assert {model.site(i).name for i in range(model.nsite)} == {arm.tcp_site, *arm.pad_geoms}
    assert [model.joint(i).name for i in range(model.njnt)] == names
    for name in arm.finger_joints:
        np.testing.assert_array_equal(model.joint(name).range, arm.finger_range)
        np.testing.assert_array_equal(model.actuator(name).ctrlrange, arm.finger_commands)
        np.testing.assert_array_equal(model.actuator(name).forcerange, [-GRIP_FORCE, GRIP_FORCE])
    assert np.multiply(2, arm.finger_range) == pytest.approx([0.0, OPENINGS[arm.name]])


def test_inertias_are_those_of_the_table(arm, model):
    table = INERTIAS[arm.name]
    assert {model.body(i).name for i in np.flatnonzero(model.body_mass)} == set(table)
    np.testing.assert_array_equal(model.body_gravcomp[1:], 1)
    for name, (mass, center, (xx, yy, zz, xy, xz, yz)) in table.items():
        body = model.body(name)
        assert body.mass[0] == mass
        np.testing.assert_allclose(body.ipos, center, atol=1e-12)
        rotation = turned(body.iquat)
        inertia = rotation @ np.diag(body.inertia) @ rotation.T
        expected = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        np.testing.assert_allclose(inertia, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("servos", [False, True])
def test_gravity_compensation_holds_home(arm, model, data, servos):
    model.opt.timestep = 0.01
    if not servos:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    start = data.qpos.copy()
    mujoco.mj_step(model, data, 200)
    np.testing.assert_allclose(data.qpos, start, atol=1e-3)
    if not servos:
        model.body_gravcomp[:] = 0.0
        mujoco.mj_step(model, data, 50)
        assert np.abs(data.qpos - start).max() > 0.1


@pytest.mark.parametrize("timestep", [0.002, 0.01])
def test_servos_reach_a_command_and_stay(arm, model, data, timestep):
    model.opt.timestep = timestep
    joints = len(arm.joints)
    command = np.array(arm.home) + 0.1 * np.array([1, -1, 1, 1, -1, 1, -1])[:joints]
    data.ctrl[:joints] = command
    limits = np.array(arm.torque_limits)
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        assert np.all(np.abs(data.actuator_force[:joints]) <= limits)
    np.testing.assert_allclose(data.qpos[:joints], command, atol=2e-3)
    np.testing.assert_allclose(data.qvel[:joints], 0.0, atol=1e-2)


def test_home_is_the_documented_pose(arm, model, data):
    np.testing.assert_allclose(data.qpos[:-2], arm.home)
    np.testing.assert_array_equal(data.qpos[-2:], arm.finger_range[1])
    np.testing.assert_array_equal(data.ctrl, data.qpos)
    assert np.all(model.jnt_range[:, 0] <= data.qpos) and np.all(data.qpos <= model.jnt_range[:, 1])
    np.testing.assert_allclose(data.site(arm.tcp_site).xpos, HOMES[arm.name], atol=2e-3)
    approach = data.site(arm.tcp_site).xmat.reshape(3, 3)[:, 2]
    assert math.degrees(math.acos(-approach[2])) < 1.0
    shoulder = data.joint(arm.joints[1]).xanchor
    assert shoulder[2] == pytest.approx(SHOULDERS[arm.name])


def test_home_is_clear_of_the_ground(arm, model, data):
    for geom in range(model.ngeom):
        # Group 3 has the shapes that collide; the base may stand on the ground.
        if model.geom_group[geom] == 3 and model.body(model.geom_bodyid[geom]).parentid[0] != 0:
            assert lowest(model, data, geom) > 0.03, model.geom(geom).name


def test_fingers_open_and_close(arm, model, data):
    fingers = [model.actuator(name).id for name in arm.finger_joints]
    tcp, pads = data.site(arm.tcp_site), [data.geom(pad) for pad in arm.pad_geoms]
    thickness = 2 * model.geom(arm.pad_geoms[0]).size[1]
    for command, opening in zip(arm.finger_commands, (0.0, OPENINGS[arm.name]), strict=True):
        data.ctrl[fingers] = command
        mujoco.mj_step(model, data, 500)
        left, right = (tcp.xmat.reshape(3, 3)[:, 1] @ (pad.xpos - tcp.xpos) for pad in pads)
        assert left - right - thickness == pytest.approx(opening, abs=5e-4)
        assert left + right == pytest.approx(0.0, abs=1e-3)
        if opening == 0.0:
            np.testing.assert_allclose(data.actuator_force[fingers], -GRIP_FORCE, rtol=0.02)


def test_one_finger_drags_the_other(arm, model, data):
    # With a command to one finger only, the equality must move both.
    follower = model.actuator(arm.finger_joints[1]).id
    model.actuator_gainprm[follower] = model.actuator_biasprm[follower] = 0.0
    data.ctrl[model.actuator(arm.finger_joints[0]).id] = 0.01
    mujoco.mj_step(model, data, 500)
    first, second = (data.joint(name).qpos[0] for name in arm.finger_joints)
    assert first == pytest.approx(0.01, abs=5e-4)
    assert second == pytest.approx(first, abs=5e-4)


def test_pads_are_about_the_tcp(arm, model, data):
    site = data.site(arm.tcp_site)
    axes = site.xmat.reshape(3, 3)
    for pad, sign in zip(arm.pad_geoms, (1, -1), strict=True):
        face = axes.T @ (data.site(pad).xpos - site.xpos)
        np.testing.assert_allclose(face[:2], [0.0, sign * arm.finger_range[1]], atol=1e-9)
        box, size = data.geom(pad), model.geom(pad).size
        inward = axes.T @ (box.xpos - site.xpos) - face
        np.testing.assert_allclose(inward, [0.0, sign * size[1], 0.0], atol=1e-9)
        assert face[2] + size[2] == pytest.approx(arm.pad_reach)


def test_looks_weigh_nothing_and_nothing_collides_yet(model):
    assert not model.geom_contype.any() and not model.geom_conaffinity.any()
    assert set(model.geom_group) == {2, 3}
    assert model.ngeom < 60
    for geom in np.flatnonzero(model.geom_group == 3):
        assert model.geom(geom).name
