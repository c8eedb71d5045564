"""Physics steps of arms in batches against MuJoCo's."""

import jax
import mujoco
import numpy as np
import pytest

from softgym_mj.robots.arm import bodies
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm_batch import chain, dynamics, models
from tests.robots.arms import arms_of

pytestmark = pytest.mark.usefixtures("double_precision")

STEPS, NUMBER = 120, 3


@arms_of("franka")
def test_a_physics_step_is_that_of_mujoco(arm):
    """Random commands saturate servos, reach limits of joints, and open and close the fingers."""
    arm = ARMS[arm]
    model, _ = models.dynamic_model(arm, 0.01)
    batched = dynamics.dynamics_of(model)

    @jax.jit
    @jax.vmap
    def step(angles, *rest):
        return dynamics.step(batched, chain.poses(batched.chain, angles), angles, *rest)[:2]

    random, joints = np.random.default_rng(0), len(arm.joints)
    motors = np.argsort(model.actuator_trnid[:, 0])
    angles = np.tile([*bodies.home(arm), *(2 * [arm.finger_range[1]])], (NUMBER, 1))
    angles[:, :joints] += random.uniform(-0.3, 0.3, (NUMBER, joints))
    angles[0, :joints] = model.jnt_range[:joints, 1] - 0.01
    datas = [mujoco.MjData(model) for _ in range(NUMBER)]
    for data, start in zip(datas, angles, strict=True):
        data.qpos[:] = start
    speeds, commands = np.zeros_like(angles), angles.copy()
    saturated = limited = 0
    for i in range(STEPS):
        commands[:, :joints] += random.uniform(-0.06, 0.06, (NUMBER, joints))
        commands[:, joints:] = arm.finger_commands[i // 40 % 2]
        for data, command in zip(datas, commands, strict=True):
            data.ctrl[motors] = command
            mujoco.mj_step(model, data)
            saturated += np.sum(np.abs(data.actuator_force) >= model.actuator_forcerange[:, 1])
            limited += np.sum(data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
        angles, speeds = step(angles, speeds, commands)
        found = np.array([[data.qpos, data.qvel] for data in datas])
        np.testing.assert_allclose(angles, found[:, 0], atol=1e-11)
        np.testing.assert_allclose(speeds, found[:, 1], atol=1e-9)
    assert saturated > 50
    assert limited > 50
