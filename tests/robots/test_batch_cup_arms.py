"""Arms with cups of different sizes in batches: inertia and physics steps against MuJoCo's."""

import jax
import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.robots.arm_batch import chain, dynamics
from softgym_mj.robots.arm_batch.cups import CupArms, Load, read_load

pytestmark = pytest.mark.usefixtures("double_precision")

VARIATIONS = 801, 806
STEPS = 20


def test_cups_of_all_sizes_weigh_on_the_arm_as_in_mujoco():
    env = softgym_mj.load("pour_water", actor="sawyer", split="all", fidelity="fast")
    actor, masses = env.task.actor, []
    arms = CupArms(actor.arm, actor.mount)
    joints = len(actor.arm.joints)

    @jax.jit
    def step(load, angles, speeds, commands, push):
        loaded = arms._loaded(load)
        pose = chain.poses(loaded.chain, angles)
        mass, _ = dynamics.mass_and_bias(loaded, pose, speeds)
        return mass, *dynamics.step(loaded, pose, angles, speeds, commands, push)[:2]

    for variation in VARIATIONS:
        env.reset(variation)
        model, data = env.physics.model.ptr, env.physics.data.ptr
        load, random = Load(**read_load(actor, model)), np.random.default_rng(0)
        for _ in range(STEPS):
            rest = env.task.water.state["rest"]
            rest[len(rest) * 7 // 19 :] = 0.0  # Forces of the water, after poses of walls.
            before = data.qpos.copy(), data.qvel.copy()
            data.ctrl[:joints] += random.uniform(-0.05, 0.05, joints)
            data.qfrc_applied[:joints] = random.uniform(-20.0, 20.0, joints)
            mujoco.mj_step(model, data)
            full = np.empty((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            mass, *after = step(load, *before, data.ctrl, data.qfrc_applied)
            np.testing.assert_allclose(mass, full, atol=1e-12)
            np.testing.assert_allclose(after[0], data.qpos, atol=1e-11)
            np.testing.assert_allclose(after[1], data.qvel, atol=1e-9)
        masses.append(full)
    assert np.abs(np.subtract(*masses)).max() > 1e-4
