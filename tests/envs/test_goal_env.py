"""Goals beside observations: rewards of both are the environment's."""

import copy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import env_checker
from stable_baselines3.common.env_checker import check_env

import softgym_mj
from softgym_mj.envs.goal_env import GoalEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.offscreen import CameraView

ROPE, POUR = "softgym_mj/RopeConfiguration-v0", "softgym_mj/PourWaterAmount-v0"


def _made(name, **settings):
    assert softgym_mj.TASKS
    return GoalEnv(gymnasium.make(name, fidelity="fast", **settings))


@pytest.mark.parametrize(
    ("name", "matching"), [(ROPE, {"matching": "vertices"}), (ROPE, {}), (POUR, {})]
)
def test_rewards_are_those_of_the_environment(name, matching):
    env = _made(name, **matching)
    env.reset(options={"variation": 812})
    action, steps = env.action_space.sample(), []
    if name == POUR:
        action[:] = 0.3, 0.5, 0.9  # Over the target, and tilted.
    for _ in range(30 if name == POUR else 4):
        seen, reward, *_, info = env.step(action)
        assert env.observation_space.contains(seen)
        steps.append((seen["achieved_goal"], seen["desired_goal"], reward))
        assert env.compute_reward(*steps[-1][:2], info) == reward
    achieved, desired, rewards = map(np.array, zip(*steps, strict=True))
    np.testing.assert_array_equal(env.compute_reward(achieved, desired, {}), rewards)
    assert len(set(rewards.tolist())) > 1
    # What has been achieved is the best goal there is.
    np.testing.assert_array_equal(env.compute_reward(achieved, achieved, {}), np.zeros(len(steps)))
    # Hindsight without any goals of its own asks for none.
    assert env.compute_reward(achieved[:0], desired[:0], []).shape == (0,)
    env.close()


@pytest.mark.parametrize("observation", ["reduced", "full"])
def test_observations_lack_the_goal(observation):
    env = _made(ROPE, observation=observation)
    seen = [env.reset(options={"variation": k})[0] for k in range(2)]
    number = {"reduced": 10, "full": 31}[observation]
    for each in seen:
        assert each["observation"].shape == (3 * number + 6,)
        if observation == "full":
            rope = each["observation"][: 3 * number]
            np.testing.assert_allclose(rope, each["achieved_goal"], atol=1e-6)
    assert not np.array_equal(seen[0]["desired_goal"], seen[1]["desired_goal"])
    env.close()


@pytest.mark.filterwarnings("ignore:observation:UserWarning")
def test_images_lack_the_goal():
    env = _made(ROPE, observation="rgb", goal_marks=False, image_size=(32, 32))
    seen, _ = env.reset(options={"variation": 2})
    plain = CameraView("task", 32, 32, marks=False).rgb(env.unwrapped.dm_env.physics)
    np.testing.assert_array_equal(seen["observation"], plain)
    assert not np.array_equal(plain, CameraView("task", 32, 32).rgb(env.unwrapped.dm_env.physics))
    env.close()


def test_checkers_find_nothing_wrong():
    env = _made(ROPE, horizon=8)
    check_env(env)
    env_checker.check_env(env, skip_render_check=True)
    env.close()


def test_copies_have_goals_of_their_own():
    env = _made(ROPE)
    env.reset(options={"variation": 3})
    other = copy.deepcopy(env)
    state = env.unwrapped.get_state()
    env.reset(options={"variation": 4})  # Of the first one only.
    action = env.action_space.sample()
    seen, reward, *_ = other.step(action)
    env.reset(options={"state": state})
    for name, expected in env.step(action)[0].items():
        np.testing.assert_array_equal(seen[name], expected)
    assert reward == other.compute_reward(seen["achieved_goal"], seen["desired_goal"], {})
    env.close(), other.close()


@pytest.mark.parametrize(
    ("achieved", "desired", "message"),
    [
        (np.zeros(3), np.zeros(3), r"achieved_goal.shape=\(3,\) is not valid: expected \(93,\)"),
        (np.zeros((2, 93)), np.zeros((1, 93)), r"desired_goal.shape=\(1, 93\).*\(2, 93\)"),
        (np.zeros((1, 1, 93)), np.zeros((1, 1, 93)), r"achieved_goal.shape=\(1, 1, 93\)"),
        (np.zeros(93), np.full(93, np.nan), "(?s)desired_goal=.*finite numbers"),
        (["a"] * 93, np.zeros(93), "(?s)achieved_goal=.*finite numbers"),
        (None, None, r"achieved_goal.shape=\(\)"),
    ],
)
def test_wrong_goals_are_refused(achieved, desired, message):
    env = _made(ROPE)
    with pytest.raises(InvalidArgumentError, match=message):
        env.compute_reward(achieved, desired, {})
    env.close()


def test_what_has_no_goals_is_refused():
    for made, name in (
        (lambda: gymnasium.make("softgym_mj/StraightenRope-v0"), "task='straighten_rope'"),
        (lambda: gymnasium.make(ROPE, observation=["reduced", "markov"]), "observation"),
        (lambda: gymnasium.make("CartPole-v1"), "env"),
        (lambda: gymnasium.make(POUR, observation="rgb"), "goal_marks=False"),
        (lambda: gymnasium.make(ROPE, observation="goal_rgb"), "observation='goal_rgb'"),
    ):
        with pytest.raises(InvalidArgumentError, match=name):
            GoalEnv(made())
