"""PourWaterAmount: shares, rewards and the red bar, worked out by hand (docs/softgym.md 3.3)."""

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.tasks.pour_water_amount import goal_share

VARIATION = 805


@pytest.fixture(name="env", scope="module")
def _env():
    return softgym_mj.load(
        "pour_water_amount", split=[VARIATION], fidelity="fast", observation=["full", "reduced"]
    )


def poured(env, number):
    """Info with this many particles in the target and the others in the cup."""
    task = env.task
    task.cup.pose = np.zeros(3)
    points = np.tile([0.0, 0.0, task.cup.size.height / 2], (task.water.num_points, 1))
    points[:number] = [task.target.pose[0], 0.0, task.target.size.height / 2]
    task.water.set_points(points)
    task.after_step(env.physics, None)
    return env.info()


def test_shares_are_uniform_and_each_variations_own():
    shares = np.array([goal_share(i) for i in range(1000)])
    assert 0.1 <= shares.min() < 0.105 and 0.995 < shares.max() <= 1.0
    assert shares.mean() == pytest.approx(0.55, abs=0.025)  # 3 sigma.
    assert len(set(shares)) == 1000
    assert goal_share(3) == shares[3]


def test_the_start_scores_zero(env):
    env.reset(VARIATION)
    number = env.task.water.num_points
    wanted = int(number * goal_share(VARIATION))
    info = env.info()
    assert info["performance"] == pytest.approx(-wanted / number)
    assert info["normalized_performance"] == 0.0 and info["poured"] == 0.0
    assert info["share"] == env.task.episode.goal["share"] == goal_share(VARIATION)


def test_the_right_amount_scores_one_and_too_much_costs_as_too_little(env):
    env.reset(VARIATION)
    number = env.task.water.num_points
    wanted = int(number * goal_share(VARIATION))
    info = poured(env, wanted)
    assert info["performance"] == pytest.approx(0.0, abs=1e-12)
    assert info["normalized_performance"] == pytest.approx(1.0) and info["success"]
    few, many = (poured(env, wanted + error) for error in (-7, 7))
    assert few["performance"] == pytest.approx(-7 / number)
    assert many["performance"] == pytest.approx(-7 / number)
    assert few["normalized_performance"] == pytest.approx(1.0 - 7 / wanted)
    everything = poured(env, number)
    assert everything["reward_missing"] == pytest.approx(-(number - wanted) / number)


def test_the_bar_is_where_facts_say(env):
    env.reset(VARIATION)
    task, (cup, target) = env.task, (env.task.cup.size, env.task.target.size)
    highest = task.water.points()[:, 2].max()
    height = target.wall / 2 + task.episode.goal["share"] * (highest - cup.wall / 2) * (
        cup.length * cup.width / (target.length * target.width)
    )
    assert task.episode.goal["level"] == pytest.approx(height, rel=1e-12)
    model, data = env.physics.model.ptr, env.physics.data.ptr
    mujoco.mj_kinematics(model, data)
    bar = model.site("level/bar").id
    near = task.target.pose[0] - target.length / 2
    np.testing.assert_allclose(data.site_xpos[bar], [near, 0.0, height], atol=1e-12)
    np.testing.assert_allclose(model.site_size[bar], [0.0025, target.width / 2, 0.0025])


def test_the_bar_tells_where_the_water_will_stand():
    """Poured to the share by the expert, the water's surface is near the bar."""
    from softgym_mj.policies.experts import make_policy

    env = softgym_mj.load("pour_water_amount", split="evaluate", fidelity="fast")
    for _ in env.play(make_policy(env), 802):
        pass
    assert env.info()["normalized_performance"] > 0.9
    positions = env.task.water.points()
    inside = positions[env.task.target.inside(positions)]
    surface = np.percentile(inside[:, 2], 98)
    assert surface == pytest.approx(env.task.episode.goal["level"], abs=0.02)


def test_states_end_with_the_goal(env):
    observation = env.reset(VARIATION).observation
    goal = [env.task.episode.goal["level"], env.task.episode.goal["share"]]
    np.testing.assert_array_equal(observation["reduced"][13:], goal)
    np.testing.assert_array_equal(observation["full"][-2:], goal)
    pour = softgym_mj.load("pour_water", split=[VARIATION], fidelity="fast")
    np.testing.assert_array_equal(
        observation["reduced"][:13], pour.reset(VARIATION).observation["reduced"]
    )
