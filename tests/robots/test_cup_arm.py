"""An arm that holds a cup: weight, reach, limits, and the experts' ways."""

import mujoco
import numpy as np
import pytest

from softgym_mj.policies.experts import make_policy
from softgym_mj.robots.arm import cup_arm
from softgym_mj.tasks.shared.carried_water import ARM_DENSITY
from tests.contract.test_contract import actions, make
from tests.policies.test_scripted import play
from tests.robots.arms import arms_of, cases_of, motor_torques

GRAVITY = 9.8  # [m/s^2]
cases = cases_of(("transport_water", "pour_water"), "transport_water/sawyer", "pour_water/franka")


def delivered(env):
    """Torques (7,) [N m] of the motors."""
    return motor_torques(env.physics.model.ptr, env.physics.data.ptr, env.task.actor.servos)


@arms_of("sawyer")
def test_the_arm_carries_the_weight_of_the_water(arm):
    env = make(f"pour_water/{arm}", horizon=1000)
    env.reset(806)
    for _ in range(5):
        env.step([0.0, 0.5, 0.0])
    for _ in range(40):
        env.step(np.zeros(3))
    model, data = env.physics.model.ptr, env.physics.data.ptr
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    jacobian = np.empty((3, model.nv))
    cup = model.body(env.task.cup.body.full_identifier).id
    middle = env.task.points().mean(axis=0)
    mujoco.mj_jac(model, data, jacobian, None, middle, cup)
    weight = ARM_DENSITY * env.task.start.variation(env.task.variation).volume * GRAVITY
    assert 5.0 < weight < 30.0  # [N]
    # The arm and the cup are compensated for: static torques are those of the water alone.
    expected = weight * jacobian[2, env.task.actor.servos.speeds_at]
    np.testing.assert_allclose(delivered(env), expected, atol=0.03 * np.abs(expected).max())


@arms_of("franka")
def test_a_cup_out_of_reach_waits_and_comes_back(arm):
    env = make(f"transport_water/{arm}", horizon=1000)
    env.reset(800)
    actor = env.task.actor
    for _ in range(15):
        env.step(-np.ones(1))
    low = actor.commanded_pose
    # The command stays within a lead of the filter, that within a lead of the reference.
    assert abs(low[0] - actor.cup.pose[0]) < cup_arm.LEAD + 0.06 + 0.02
    assert env.info()["ik_failures"] == 0
    before = actor.cup.pose[0]
    for _ in range(9):
        env.step(np.ones(1))
    assert actor.cup.pose[0] > before + 0.15  # At first as slow as a stretched elbow bends.
    np.testing.assert_array_equal(actor.commanded_pose[1:], 0.0)


@cases
def test_reference_and_cup_follow_the_command_and_the_expert_solves_it(case):
    """On the expert's way: reach, lag and droop."""
    env = make(case)
    act, timestep = make_policy(env), env.reset(806)
    largest = np.array(env.task.actor.arm.torque_limits)
    references, cups = [], []
    while not timestep.last():
        timestep = env.step(act(timestep))
        actor = env.task.actor
        points = actor._filtered_command.points[0] / cup_arm.TURNS_AS
        references.append(np.abs(actor.reference_pose - points))
        cups.append(np.abs(actor.cup.pose - actor.reference_pose))
        # Torques within the limits, but for what contact adds in the very step.
        assert np.all(np.abs(delivered(env)) < 1.02 * largest)
    # The reference may be a solution (0.02 s) behind a filter of up to 0.8 m/s and 1 rad/s.
    assert np.max(references, axis=0)[:2].max() < 0.025
    assert np.max(cups, axis=0)[:2].max() < 0.02  # [m]: water of up to 1.6 kg weighs on it.
    assert np.mean(cups, axis=0)[:2].max() < 0.01
    assert np.max(cups, axis=0)[2] < 0.03  # [rad]
    assert env.info()["normalized_performance"] > 0.97


@cases
def test_random_actions_are_clean(case):
    env = make(case, observation="reduced")
    env.reset(801)
    actor = env.task.actor
    for action in actions(env, 20):
        env.step(action)
        assert np.all(np.abs(actor.controller.velocity) <= np.add(actor.arm.velocity_limits, 1e-9))
        off = np.abs(actor.cup.pose - actor.reference_pose)
        assert off[:2].max() < 0.05 and off[2] < 0.05  # Reversals from 1 to -1 m/s.
        assert env.info()["ik_failures"] == 0
    assert env.info()["physics_warnings"] == 0


@arms_of()
@pytest.mark.parametrize("task", ["transport_water", "pour_water", "pour_water_amount"])
def test_the_experts_do_as_well_with_arms(task, arm):
    for_arm = [play(task, v, actor=arm)["normalized_performance"] for v in range(800, 820)]
    for_cup = [play(task, v)["normalized_performance"] for v in range(800, 820)]
    assert np.mean(for_arm) >= 0.8 * np.mean(for_cup)
