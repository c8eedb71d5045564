"""Arms in batches, with nothing on their hands, against the same arms in environments."""

import functools

import jax
import mujoco
import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.arm.joint_servos import SOLVE_EVERY
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm_batch.pushed import PushedArms
from softgym_mj.robots.arm_batch.state import packed, read_state
from softgym_mj.robots.base import SIM_STEP
from tests.robots.arms import usually
from tests.scenes import arm_paths

SIM_STEPS = 8
PUSHING = "hand_collision", "left_pad", "right_pad"


@functools.cache
def batch_of(arm, mounts):
    """Arms whose functions are compiled once for all tests."""
    return PushedArms(ARMS[arm], mounts, "attach", "position")


class Scene:
    """Arms that random actions move; the object lies out of reach."""

    def __init__(self, arm, number, seed):
        self.model, self.data, self.arms = arm_paths.scene("rope", arm, number)
        points = np.array([[0.05, -0.2, 0.15], [-0.1, 0.15, 0.25]])[:number]
        self.arms.place(points, arm_paths.WORKSPACE)
        self.random = np.random.default_rng(seed)

    def action(self):
        return self.random.uniform(-1.0, 1.0, self.arms.action_size)

    def begin(self):
        self.arms.plan()
        self.arms.move(1.0, SIM_STEP)

    def step(self, action):
        self.arms.command(action)
        for _ in range(SIM_STEPS):
            self.begin()
            mujoco.mj_step(self.model, self.data)


def begun(scenes):
    """The batch of scenes with the same arms, and its state."""
    batch = batch_of(scenes[0].arms.arm.name, scenes[0].arms.mounts)
    rows = [read_state(scene.arms) for scene in scenes]
    return batch, packed({name: np.stack([row[name] for row in rows]) for name in rows[0]})


def stepped(batch, state, actions):
    """State, `Ended` and motion of the hands' solids in each sim step, after an env step."""
    with jax.enable_x64(True):
        push, solid = batch.no_push(len(actions), jax.devices()[0]), actions[:, 3::4] < np.inf
        nowhere = np.full((len(actions), 1, 3), np.inf)
        motions = []
        for k in range(SIM_STEPS):
            phase = k % SOLVE_EVERY
            state = batch.solve(state, actions) if phase == 0 else state
            state, _, hands = batch.step_alone(state, push, actions, nowhere, {}, solid, phase)
            motions.append([np.asarray(each) for each in hands.solids])
        return *batch.finish(state, push), motions


@usually("case", ["franka/2", "sawyer/2", "ur5e/1"], "franka/2")
def test_random_actions_move_arms_as_in_environments(case):
    arm, number = case.split("/")
    scenes = [Scene(arm, int(number), seed) for seed in range(3)]
    batch, state = begun(scenes)
    for _ in range(15):
        actions = np.array([scene.action() for scene in scenes])
        state, ended, _ = stepped(batch, state, actions)
        for scene, action in zip(scenes, actions, strict=True):
            scene.step(action)
        expected = [scene.arms.proprioception() for scene in scenes]
        np.testing.assert_allclose(ended.sensed, expected, atol=1e-3)  # Speeds [rad/s].
        points = slice(3 * int(number))
        np.testing.assert_allclose(
            ended.sensed[:, points], np.array(expected)[:, points], atol=1e-5
        )
        np.testing.assert_allclose(
            state.filter.commanded, [scene.arms.commanded_positions() for scene in scenes],
            atol=1e-6,
        )  # fmt: skip
    assert not np.any(state.failures)


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
    batch, state = begun(scenes)
    for _ in range(3):
        actions = np.array([scene.action() for scene in scenes])
        state, _, motions = stepped(batch, state, actions)
        for i, (scene, action) in enumerate(zip(scenes, actions, strict=True)):
            model, data = scene.model, scene.data
            scene.arms.command(action)
            for motion in motions:
                scene.begin()
                positions, matrices, jacobians = pushing(model, data, 2)
                before = data.qvel.copy()
                mujoco.mj_step(model, data)
                poses, velocities, accelerations = (array[i] for array in motion)
                np.testing.assert_allclose(poses[..., :3], positions, atol=1e-6)
                quaternions = poses[..., 3:].reshape(-1, 4)
                expected = matrices.reshape(-1, 9)
                for quaternion, matrix in zip(quaternions, expected, strict=True):
                    found = np.empty(9)
                    mujoco.mju_quat2Mat(found, quaternion)
                    np.testing.assert_allclose(found, matrix, atol=1e-6)
                np.testing.assert_allclose(velocities, jacobians @ before, atol=1e-5)
                change = (data.qvel - before) / SIM_STEP
                np.testing.assert_allclose(accelerations, jacobians @ change, atol=1e-3)


def test_environments_do_not_touch_each_other():
    batch, state = begun([Scene("franka", 2, seed) for seed in range(3)])
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 3, 8))

    def played(state):
        for action in actions:
            state, ended, _ = stepped(batch, state, action)
        return np.asarray(ended.sensed)

    first, speeds, reference = played(state), state.speeds.copy(), state.reference.copy()
    speeds[1] = reference[1] = np.nan
    again = played(state._replace(speeds=speeds, reference=reference))
    assert np.isnan(again[1]).any()
    np.testing.assert_array_equal(again[[0, 2]], first[[0, 2]])


def test_arms_between_two_solutions_are_refused():
    scene = Scene("franka", 1, 0)
    scene.arms.command(np.zeros(4))
    scene.arms.plan()
    with pytest.raises(InvalidArgumentError, match="phase=0"):
        read_state(scene.arms)
