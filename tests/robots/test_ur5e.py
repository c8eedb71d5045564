"""The UR5e against its Denavit-Hartenberg parameters, as Universal Robots publishes them."""

import math

import mujoco
import numpy as np
import pytest

from softgym_mj.robots.arm.models import UR5E

# A row for each joint: a, d [m], alpha [rad].
DH = (
    (0.0, 0.1625, math.pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.3922, 0.0, 0.0),
    (0.0, 0.1333, math.pi / 2),
    (0.0, 0.0997, -math.pi / 2),
    (0.0, 0.0996, 0.0),
)
# A row for each link: mass [kg], center of mass [m] in the frame at its end.
LINKS = (
    (3.761, (0.0, -0.02561, 0.00193)),
    (8.058, (0.2125, 0.0, 0.11336)),
    (2.846, (0.15, 0.0, 0.0265)),
    (1.37, (0.0, -0.0018, 0.01634)),
    (1.3, (0.0, 0.0018, 0.01634)),
    (0.365, (0.0, 0.0, -0.001159)),
)
INERTIAS = (  # [kg m^2] xx yy zz xy xz yz about it, along the axes of that frame.
    (0.00700210, 0.00648091, 0.00657286, 0.00000073, -0.00001053, 0.00049994),
    (0.01505885, 0.33388086, 0.33247207, -0.00005400, 0.00000563, -0.00000181),
    (0.00399632, 0.07879254, 0.07848510, -0.00001365, 0.00137272, -0.00000660),
    (0.00165491, 0.00135962, 0.00126279, -0.00000282, -0.00000438, 0.00010157),
    (0.00135617, 0.00127827, 0.00096614, -0.00000274, 0.00000444, -0.00005048),
    (0.00018694, 0.00018908, 0.00025756, 0.00000006, -0.00000017, -0.00000092),
)
BODIES = (
    "shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link",
    "wrist_3_link",
)  # fmt: skip


def frames(angles):
    """Poses (6, 4, 4) of the frames at the ends of the links. Ours faces +X, theirs -X."""
    pose, poses = np.diag([-1.0, -1.0, 1.0, 1.0]), []
    for angle, (a, d, alpha) in zip(angles, DH, strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        step = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d]]
        pose = pose @ np.array([*step, [0, 0, 0, 1]])
        poses.append(pose)
    return np.array(poses)


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_path(UR5E.xml_path)


@pytest.fixture
def postures(model):
    """Pairs of mjData and the angles (6,) [rad] that it is at."""

    def generate():
        data, (low, high) = mujoco.MjData(model), model.jnt_range[:6].T
        for angles in np.random.default_rng(0).uniform(low, high, (50, 6)):
            data.qpos[:6] = angles
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            yield data, angles

    return generate()


def test_the_flange_is_the_last_frame(postures):
    for data, angles in postures:
        last, flange = frames(angles)[-1], data.body("hand")
        np.testing.assert_allclose(flange.xpos, last[:3, 3], atol=1e-9)
        np.testing.assert_allclose(flange.xmat.reshape(3, 3), last[:3, :3], atol=1e-9)


def test_masses_are_where_they_are_published_to_be(model, postures):
    for data, angles in postures:
        for pose, name, (mass, center), (xx, yy, zz, xy, xz, yz) in zip(
            frames(angles), BODIES, LINKS, INERTIAS, strict=True
        ):
            body = data.body(name)
            assert model.body(name).mass[0] == mass
            np.testing.assert_allclose(body.xipos, (pose @ [*center, 1.0])[:3], atol=1e-9)
            axes, turn = body.ximat.reshape(3, 3), pose[:3, :3]
            inertia = axes @ np.diag(model.body(name).inertia) @ axes.T
            published = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            np.testing.assert_allclose(inertia, turn @ published @ turn.T, atol=1e-8)


def test_the_whole_moves_the_published_mass(model):
    shoulder = model.body("shoulder_link").id
    gripper = sum(model.body(name).mass[0] for name in ("hand", "left_finger", "right_finger"))
    assert model.body_subtreemass[shoulder] - gripper == pytest.approx(17.7)
    assert gripper == pytest.approx(0.9)  # All parts of Menagerie's 2F-85.


def test_the_wrist_gets_as_far_as_published(model):
    """850 mm from the axis of the base, with the arm stretched out."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    reach = math.hypot(*data.body("wrist_2_link").xpos[:2])
    assert reach == pytest.approx(math.hypot(0.425 + 0.3922, 0.1333))
    assert reach == pytest.approx(0.85, abs=0.025)
