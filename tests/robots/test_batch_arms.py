"""Arms in batches against the same arms in environments."""

import functools

import jax
import mujoco
import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts import make_policy
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm_batch.arms import ArmBatch
from softgym_mj.robots.arm_batch.state import control_state, read_state
from softgym_mj.robots.base import SIM_STEP
from tests.robots.arms import usually
from tests.scenes import arm_paths

SIM_STEPS = 8
PUSHING = "hand_collision", "left_pad", "right_pad"


@functools.cache
def batch_of(arm, mounts, timestep):
    """A batch whose steps are compiled once for all tests."""
    return ArmBatch(ARMS[arm], mounts, timestep)


def batch_like(arms, timestep):
    return batch_of(arms.arm.name, arms.mounts, timestep)


def measured(arms):
    """Joint angles, tool points, velocities, rotations and openings of one environment."""
    servos, number = arms.servos, arms.num_grippers
    joints = servos.fingers.data.qpos[servos.positions_at].reshape(number, -1)
    points = servos.points()
    found = joints, points, servos.velocities(), servos.rotations(), servos.fingers.openings
    return [np.array(each) for each in found]


def at_end(motion, t=-1):
    """The same of all environments."""
    found = motion.joints, motion.points, motion.velocities, motion.rotations, motion.openings
    return [np.asarray(each[t]) for each in found]


class Scene:
    """Arms that random actions move; the object lies out of reach."""

    def __init__(self, arm, number, seed, timestep=SIM_STEP):
        found = arm_paths.scene("rope", arm, number, timestep=timestep)
        self.model, self.data, self.arms = found
        points = np.array([[0.05, -0.2, 0.15], [-0.1, 0.15, 0.25]])[:number]
        self.arms.place(points, arm_paths.WORKSPACE)
        self.random = np.random.default_rng(seed)

    def action(self):
        return self.random.uniform(-1.0, 1.0, self.arms.action_size)

    def step(self, action):
        self.arms.command(action)
        for _ in range(SIM_STEPS):
            self.arms.plan()
            parts = round(SIM_STEP / self.model.opt.timestep)
            for i in range(parts):
                self.arms.move((i + 1) / parts, self.model.opt.timestep)
                mujoco.mj_step(self.model, self.data)


@usually("case", ["franka/2/.01", "sawyer/2/.01", "ur5e/1/.005"], "franka/2/.01")
def test_random_actions_move_arms_as_in_environments(case):
    arm, number, timestep = case.split("/")
    scenes = [Scene(arm, int(number), seed, float(timestep)) for seed in range(3)]
    arms = scenes[0].arms
    batch = batch_like(arms, scenes[0].model.opt.timestep)
    state = batch.stack([read_state(scene.arms) for scene in scenes])
    for _ in range(15):
        actions = np.array([scene.action() for scene in scenes])
        state, motion = batch.step(state, actions, SIM_STEPS)
        for scene, action in zip(scenes, actions, strict=True):
            scene.step(action)
        expected = map(np.array, zip(*(measured(scene.arms) for scene in scenes), strict=True))
        tolerances = 1e-4, 1e-5, 1e-3, 1e-4, 1e-6
        for found, value, tolerance in zip(at_end(motion), expected, tolerances, strict=True):
            np.testing.assert_allclose(found, value, atol=tolerance)
        np.testing.assert_allclose(
            state.filter.commanded, [scene.arms.commanded_positions() for scene in scenes],
            atol=1e-6,
        )  # fmt: skip
    assert not np.any(state.failures)


@pytest.mark.parametrize(
    "task",
    [
        "straighten_rope",
        pytest.param("fold_cloth", marks=pytest.mark.long),
        pytest.param("spread_cloth", marks=pytest.mark.long),
    ],
)
def test_experts_move_arms_as_in_environments(task):
    """What pushes on hands is neglected: 1 mm by a rope, 6 mm by crumpled cloth."""
    env = softgym_mj.load(task, actor="franka", arms=2)
    arms, rows, actions, recorded = env.task.actor, [], [], []
    batch = batch_like(arms, env.physics.model.opt.timestep)
    for variation in (800, 801):
        timestep = env.reset(variation)
        policy = make_policy(env)
        rows.append(read_state(arms))
        actions.append([])
        recorded.append([])
        for _ in range(20):
            actions[-1].append(policy(timestep))
            timestep = env.step(actions[-1][-1])
            joints, points, *_ = measured(arms)
            reference = arms.controller.configuration.reshape(joints.shape)
            recorded[-1].append([reference, joints, points])
    own, differences = [0, 1, 0], []  # As many as in the other tests: steps are compiled once.
    state = batch.stack([rows[k] for k in own])
    for i in range(20):
        state, motion = batch.step(state, np.array([actions[k][i] for k in own]), SIM_STEPS)
        found = state.reference, motion.joints[-1], motion.points[-1]
        expected = map(np.array, zip(*(recorded[k][i] for k in own), strict=True))
        pairs = zip(map(np.asarray, found), expected, strict=True)
        differences.append([np.abs(a - b) for a, b in pairs])
    references, joints, points = (np.array([each[k] for each in differences]) for k in range(3))
    assert references.max() < 1e-6
    assert np.sqrt(np.mean(joints**2)) < 1e-3
    assert points.max() < 8e-3
    if task != "spread_cloth":
        assert points.max() < 2e-3
        assert points.max((0, 2, 3)).min() < 1e-6  # Nothing pushes in one of the two.
    assert np.ptp([each[0] for each in recorded[0]], axis=0).max() > 0.1  # The arms moved.


def pushing(model, data, number):
    """Poses, velocities and accelerations of the hands' solids of a scene before a step."""
    names = [f"arms/franka_{i}/{geom}" for i in range(number) for geom in PUSHING]
    geoms = [model.geom(name).id for name in names]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    found, jacobian = [], np.empty((2, 3, model.nv))
    for geom in geoms:
        body = model.geom_bodyid[geom]
        mujoco.mj_jac(model, data, *jacobian, data.xipos[body], body)
        pose = data.geom_xpos[geom], data.geom_xmat[geom]
        found.append([*(a.copy() for a in pose), jacobian.reshape(6, -1).copy()])
    return [np.array(a).reshape(number, -1, *np.shape(a)[1:]) for a in zip(*found, strict=True)]


def test_solids_of_hands_move_as_in_environments():
    scenes = [Scene("franka", 2, seed) for seed in range(3)]
    batch = batch_like(scenes[0].arms, scenes[0].model.opt.timestep)
    state = batch.stack([read_state(scene.arms) for scene in scenes])
    for _ in range(3):
        actions = np.array([scene.action() for scene in scenes])
        state, motion = batch.step(state, actions, SIM_STEPS)
        for i, (scene, action) in enumerate(zip(scenes, actions, strict=True)):
            model, data, h = scene.model, scene.data, scene.model.opt.timestep
            scene.arms.command(action)
            for t in range(SIM_STEPS):
                scene.arms.plan()
                scene.arms.move(1.0, h)
                positions, matrices, jacobians = pushing(model, data, 2)
                before = data.qvel.copy()
                mujoco.mj_step(model, data)
                poses, velocities, accelerations = (np.asarray(a[t, i]) for a in motion.solids)
                np.testing.assert_allclose(poses[..., :3], positions, atol=1e-6)
                quaternions = poses[..., 3:].reshape(-1, 4)
                expected = matrices.reshape(-1, 9)
                for quaternion, matrix in zip(quaternions, expected, strict=True):
                    found = np.empty(9)
                    mujoco.mju_quat2Mat(found, quaternion)
                    np.testing.assert_allclose(found, matrix, atol=1e-6)
                np.testing.assert_allclose(velocities, jacobians @ before, atol=1e-5)
                change = (data.qvel - before) / h
                np.testing.assert_allclose(accelerations, jacobians @ change, atol=1e-3)


def test_an_environment_goes_on_from_a_batch():
    scenes = [Scene("franka", 2, seed) for seed in range(3)]
    batch = batch_like(scenes[0].arms, scenes[0].model.opt.timestep)
    state = batch.stack([read_state(scene.arms) for scene in scenes])
    actions = np.random.default_rng(2).uniform(-1.0, 1.0, (6, 3, 8))
    for action in actions[:3]:
        state, _ = batch.step(state, action, SIM_STEPS)
    later, arms = scenes[0], scenes[0].arms  # Takes the place of environment 1.
    states = arms.get_state() | control_state(
        jax.tree.map(lambda array: np.asarray(array)[1], state)
    )
    servos, fingers = arms.servos, arms.servos.fingers
    joints = len(servos.joints)
    for array, found, own, hands in (
        (later.data.qpos, state.positions, servos.positions_at, fingers.positions_at),
        (later.data.qvel, state.speeds, servos.speeds_at, fingers.speeds_at),
    ):
        array[own] = np.asarray(found)[1, :, :joints].ravel()
        array[hands] = np.asarray(found)[1, :, joints:]
    arms.set_state(states)
    row = read_state(arms)
    np.testing.assert_array_equal(row["rates"], np.asarray(state.rates)[1])
    for action in actions[3:]:
        state, motion = batch.step(state, action, SIM_STEPS)
        later.step(action[1])
    np.testing.assert_allclose(np.asarray(motion.points)[-1, 1], arms.positions(), atol=1e-6)


def test_runs_give_the_same_bits_and_environments_do_not_touch_each_other():
    scenes = [Scene("franka", 2, seed) for seed in range(3)]
    batch = batch_like(scenes[0].arms, scenes[0].model.opt.timestep)
    rows = [read_state(scene.arms) for scene in scenes]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 3, 8))

    def played():
        state, points = batch.stack(rows), []
        for action in actions:
            state, motion = batch.step(state, action, SIM_STEPS)
            points.append(np.asarray(motion.points))
        return np.concatenate(points)

    first = played()
    np.testing.assert_array_equal(played(), first)
    rows[1]["speeds"] = np.full_like(rows[1]["speeds"], np.nan)
    rows[1]["reference"] = np.full_like(rows[1]["reference"], np.nan)
    again = played()
    assert np.isnan(again[-1, 1]).all()
    np.testing.assert_array_equal(again[:, [0, 2]], first[:, [0, 2]])


def test_arrays_are_shared_with_pytorch():
    scenes = [Scene("franka", 2, seed) for seed in range(3)]
    batch = batch_like(scenes[0].arms, scenes[0].model.opt.timestep)
    state = batch.stack([read_state(scene.arms) for scene in scenes])
    actions = torch.zeros((3, 8), dtype=torch.float64)
    with jax.enable_x64(True):
        assert jax.dlpack.from_dlpack(actions).unsafe_buffer_pointer() == actions.data_ptr()
    _, motion = batch.step(state, actions, SIM_STEPS)
    shared = torch.from_dlpack(motion.points)
    assert shared.dtype == torch.float64
    assert shared.data_ptr() == motion.points.unsafe_buffer_pointer()
    # Actions of zero leave the hands where they are.
    start = np.array([scene.arms.positions() for scene in scenes])
    np.testing.assert_allclose(shared[-1], start, atol=2e-3)


def test_what_batches_cannot_do_is_refused():
    scene = Scene("franka", 1, 0)
    batch = ArmBatch.of(scene.arms)
    row = read_state(scene.arms)
    with pytest.raises(InvalidArgumentError, match="sim_steps=7"):
        batch.step(batch.stack([row]), np.zeros((1, 4)), 7)
    scene.arms.command(np.zeros(4))
    scene.arms.plan()
    with pytest.raises(InvalidArgumentError, match="phase=0"):
        read_state(scene.arms)
