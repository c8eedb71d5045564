"""Inverse kinematics of arms in batches against mink's, and their parts."""

import jax
import mink
import mujoco
import numpy as np
import pytest
import qpsolvers

from softgym_mj.robots.arm import bodies
from softgym_mj.robots.arm.joint_servos import JointServos
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm.mounts import facing_each_other
from softgym_mj.robots.arm_batch import chain, clearance, inverse_kinematics, quadratic, twists
from tests.robots.arms import arms_of

pytestmark = pytest.mark.usefixtures("double_precision")

NUMBER, STEPS = 3, 80


def test_minima_of_quadratic_programs_are_those_of_another_solver():
    random, number, size = np.random.default_rng(0), 40, 14
    tasks = random.normal(size=(number, 6, size))
    matrices = np.einsum("bij,bik->bjk", tasks, tasks) + 2e-6 * np.eye(size)
    vectors = np.einsum("bij,bi->bj", tasks, random.normal(size=(number, 6)) / 10)
    own = np.tile(np.vstack([np.eye(size), -np.eye(size)]), (number, 1, 1))
    rows = np.concatenate([own, random.normal(size=(number, 12, size))], axis=1)
    near, others = np.full((number, 2 * size), 0.03), random.uniform(0, 0.05, (number, 12))
    bounds = np.concatenate([near, others], axis=1)
    bounds[:, -4:] = np.inf
    bounds[::4] += 1.0
    # The last two have no solution, or are not finite.
    rows[-2, -1], rows[-2, -2], bounds[-2, -2:] = rows[-2, 0], -rows[-2, 0], [0.01, -0.02]
    vectors[-1, 0] = np.nan
    found = jax.jit(jax.vmap(quadratic.minimize))(matrices, vectors, rows, bounds)
    assert found.found.tolist() == [True] * (number - 2) + [False] * 2
    assert np.min(found.iterations) == 0 and np.max(found.iterations) > 8
    for i in range(number - 2):
        counts = np.isfinite(bounds[i])
        program = matrices[i], vectors[i], rows[i][counts], bounds[i][counts]
        expected = qpsolvers.solve_qp(*program, solver="daqp")
        np.testing.assert_allclose(found.point[i], expected, atol=1e-8)


def test_twists_are_those_of_mink():
    random = np.random.default_rng(0)
    logarithm, inverse = jax.jit(twists.logarithm), jax.jit(twists.inverse_jacobian)
    for angle in (0.0, 1e-7, 1e-3, 0.009, 0.011, 0.1, 1.0, 3.1):
        turn = random.normal(size=3)
        rotation = mink.SO3.exp(angle * turn / np.linalg.norm(turn))
        motion = mink.SE3.from_rotation_and_translation(rotation, random.normal(size=3))
        twist = logarithm(rotation.as_matrix(), motion.translation())
        np.testing.assert_allclose(twist, motion.log(), atol=1e-10)
        np.testing.assert_allclose(inverse(twist), mink.SE3.ljacinv(motion.log()), atol=1e-9)


SHAPES = """
<mujoco><worldbody>
<geom type="plane" size="1 1 1"/>
<geom type="box" size=".1 .03 .2"/><geom type="capsule" size=".05 .2"/>
<geom type="cylinder" size=".1 .05"/><geom type="sphere" size=".1"/>
<geom type="box" size=".1 .2 .05"/><geom type="capsule" size=".03 .1"/>
<geom type="cylinder" size=".05 .2"/><geom type="sphere" size=".02"/>
</worldbody></mujoco>
"""


def test_distances_are_those_of_mujoco():
    model, random = mujoco.MjModel.from_xml_string(SHAPES), np.random.default_rng(0)
    data, ends = mujoco.MjData(model), np.empty(6)
    model.geom_sameframe[:] = 0
    geoms = range(1, 5), range(5, 9)
    one, other = (clearance.shapes_of(model, list(ids)) for ids in geoms)
    nearest = jax.jit(lambda *poses: clearance.nearest(one, poses[:2], other, poses[2:]))
    lowest = jax.jit(lambda *pose: clearance.lowest(one, *pose))
    for _ in range(20):
        model.geom_quat[1:] = random.normal(size=(8, 4))
        model.geom_quat[1:] /= np.linalg.norm(model.geom_quat[1:], axis=1, keepdims=True)
        model.geom_pos[1:] = random.normal(size=(8, 3))
        model.geom_pos[1:, 2] += 3.0
        mujoco.mj_kinematics(model, data)
        first, second = (
            (data.geom_xpos[ids], data.geom_xmat[ids].reshape(-1, 3, 3)) for ids in map(list, geoms)
        )
        low, found = lowest(*first), nearest(*first, *second)
        for i, a in enumerate(geoms[0]):
            height = mujoco.mj_geomDistance(model, data, 0, a, 10.0, ends)
            np.testing.assert_allclose(low[i], ends[3:], atol=1e-9)
            np.testing.assert_allclose(low[i, 2], height, atol=1e-9)
            for j, b in enumerate(geoms[1]):
                expected = mujoco.mj_geomDistance(model, data, a, b, 10.0, ends)
                if expected < 0.01:
                    continue
                np.testing.assert_allclose(found.distance[i, j], expected, atol=2e-4)
                normal = (ends[3:] - ends[:3]) / expected
                assert found.normal[i, j] @ normal > 0.999


def placed(arms, joints):
    """Positions and rotations of tools for joint angles (arms, m)."""
    poses = jax.vmap(lambda own: chain.poses(arms.chain, own))(joints)
    return inverse_kinematics.hands(arms, arms.chain, poses, joints)


@arms_of("franka")
def test_references_follow_as_those_of_the_controller(arm):
    """Commands press the tools on the floor and on each other, and leave the arms' reach.

    Parallel faces have many nearest points, of which the two choose others.
    """
    arm, random = ARMS[arm], np.random.default_rng(1)
    mounts = facing_each_other(2, arm.distance, *arm.reach)
    arms = inverse_kinematics.kinematics_of(arm, mounts, 0.0)
    follow = jax.jit(jax.vmap(lambda *own: inverse_kinematics.follow_points(arms, *own)))
    place = jax.jit(jax.vmap(lambda own: placed(arms, own)))
    controllers, goals = [], np.zeros((NUMBER, 2, 3))
    for goal in goals:
        controllers.append(JointServos(arm, mounts, bodies.home(arm)).controller)
        goal[:] = [[0.0, -0.15, 0.2], [0.0, 0.15, 0.2]] + random.uniform(-0.1, 0.1, (2, 3))
        controllers[-1].reset(goal)
    differences, low, near = [], 0, 0
    for i in range(STEPS):
        if i % 15 == 0:
            speeds = random.uniform(-0.03, 0.03, goals.shape)
            if i % 30 == 0:
                speeds[:, :, 1] = [0.02, -0.02]
        goals = np.clip(goals + speeds, [-0.4, -0.6, 0.0], [0.4, 0.6, 0.4])
        joints = np.array([controller.configuration for controller in controllers])
        for goal, controller in zip(goals, controllers, strict=True):
            goal[:] = controller.within_lead(goal)
            controller.follow_points(goal)
        found = follow(joints.reshape(NUMBER, 2, -1), goals)
        assert not found.failed.any()
        after = np.array([controller.configuration for controller in controllers])
        differences.append(np.abs(found.angles.reshape(after.shape) - after).max())
        np.testing.assert_allclose(
            found.speeds.reshape(after.shape),
            [controller.velocity for controller in controllers],
            atol=0.15,
        )
        after = after.reshape(NUMBER, 2, -1)
        tools, rotations, _ = place(after)
        expected = np.array([controller.points() for controller in controllers])
        np.testing.assert_allclose(tools, expected, atol=1e-12)
        expected = np.array([controller.rotations() for controller in controllers])
        np.testing.assert_allclose(rotations, expected, atol=1e-12)
        low += np.sum(tools[..., 2] < arm.pad_reach + 0.02)
        near += np.sum(np.linalg.norm(tools[:, 0] - tools[:, 1], axis=1) < 0.15)
    assert max(differences) < 3e-3
    assert np.mean(np.array(differences) > 1e-5) < 0.1
    assert np.median(differences) < 1e-8
    assert low > 2
    assert near > 2


def test_a_configuration_that_is_not_finite_changes_no_other():
    arm = ARMS["franka"]
    mounts = facing_each_other(1, arm.distance, *arm.reach)
    arms = inverse_kinematics.kinematics_of(arm, mounts, 0.0)
    follow = jax.jit(jax.vmap(lambda *own: inverse_kinematics.follow_points(arms, *own)))
    joints = np.tile(bodies.home(arm), (3, 1, 1))
    goals = np.array([[[0.0, -0.2, 0.3]], [[0.1, -0.2, 0.3]], [[0.2, -0.2, 0.3]]])
    before = follow(joints, goals)
    joints[1, 0, 2] = np.nan
    after = follow(joints, goals)
    assert after.failed.tolist() == [False, True, False]
    for i in (0, 2):
        np.testing.assert_array_equal(after.angles[i], before.angles[i])
