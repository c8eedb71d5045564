"""Every task with every arm: contract, snapshots, segmentation, random episodes."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import softgym_mj
from softgym_mj.rendering.observables import LABELS
from tests.contract import test_contract, test_snapshots
from tests.contract.test_contract import actions, make
from tests.robots.arms import cases_of

# Golden episodes, too, have all tasks and arms.
cases = cases_of(softgym_mj.TASKS, "straighten_rope/sawyer", "pour_water/franka")


@cases
def test_the_contract_of_every_task_holds(case):
    test_contract.test_specs_match_what_is_returned(case)
    test_contract.test_gymnasium_check_env(case)


@cases
def test_a_restore_continues_bit_equal(case):
    test_snapshots.test_a_restore_continues_bit_equal(case)


@cases
def test_the_states_end_with_what_the_arms_sense(case):
    env = make(case, observation=["full", "reduced"])
    env.reset(800)
    observation = env.step(actions(env, 1)[0]).observation
    actor, named = env.task.actor, env.physics.named.data
    number, joints = 1 if "water" in case else 2, len(actor.arm.joints)
    size = number * (8 + 2 * joints)
    sensed = observation["reduced"][-size:]
    np.testing.assert_array_equal(observation["full"][-size:], sensed)
    mujoco.mj_kinematics(env.physics.model.ptr, env.physics.data.ptr)
    for i, own in enumerate(sensed[3 * number :].reshape(number, -1)):
        prefix = f"arms/{actor.arm.name}_{i}/"
        names = [f"{prefix}{joint}" for joint in actor.arm.joints]
        fingers = [f"{prefix}{joint}" for joint in actor.arm.finger_joints]
        tool = f"{prefix}{actor.arm.tcp_site}"
        np.testing.assert_allclose(sensed[3 * i : 3 * i + 3], named.site_xpos[tool], atol=1e-9)
        turn = Rotation.from_quat(own[:4], scalar_first=True).as_matrix().ravel()
        np.testing.assert_allclose(turn, named.site_xmat[tool], atol=1e-9)
        np.testing.assert_array_equal(own[5 : 5 + joints], named.qpos[names])
        np.testing.assert_array_equal(own[5 + joints :], named.qvel[names])
        assert own[4] == named.qpos[fingers].sum()


@cases
def test_the_camera_shows_object_and_actor(case):
    env = make(case, observation="segmentation")
    seen = env.reset(800).observation["segmentation"]
    shown = {"object", "actor"} | ({"container"} if "water" in case else set())
    for name in shown:
        assert np.mean(seen == LABELS.index(name)) > 0.001, name


@cases_of(softgym_mj.TASKS)
def test_twenty_random_episodes_are_clean(case):
    env = make(case, observation="reduced")
    for variation in range(800, 820):
        env.reset(variation)
        failures = 0
        for action in actions(env, env.horizon, seed=variation):
            observation = env.step(action).observation["reduced"]
            failures += env.info()["ik_failures"]
            assert np.isfinite(observation).all()
        assert failures == 0
        assert env.info()["physics_warnings"] == 0
