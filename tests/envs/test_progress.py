"""`ProgressReward`: its rewards add up to what an episode has gained."""

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.progress import ProgressReward

IDENTIFIER = softgym_mj.TASKS["straighten_rope"].gymnasium_id


def rewards(env, seed):
    """Returns the rewards of an episode of random actions, and its last score."""
    random, found, truncated = np.random.default_rng(seed), [], False
    while not truncated:
        _, reward, terminated, truncated, info = env.step(random.uniform(-1, 1, 8))
        assert not terminated
        found.append(reward)
    return np.array(found), info["normalized_performance"]


def test_rewards_are_the_gain_of_each_step():
    """A plain environment's scores are the oracle; two episodes, so that the first is forgotten."""
    env = ProgressReward(gymnasium.make(IDENTIFIER, horizon=8))
    plain = gymnasium.make(IDENTIFIER, horizon=8)
    for variation in (0, 1):
        _, start = env.reset(options={"variation": variation})
        _, info = plain.reset(options={"variation": variation})
        random, scores = np.random.default_rng(variation), [info["normalized_performance"]]
        for _ in range(8):
            *_, info = plain.step(random.uniform(-1, 1, 8))
            scores.append(info["normalized_performance"])
        found, end = rewards(env, variation)
        np.testing.assert_array_equal(found, np.diff(scores))
        assert found.any() and end == scores[-1]
        assert found.sum() == pytest.approx(end - start["normalized_performance"], abs=1e-14)


def test_an_episode_that_continues_is_rewarded_from_there():
    env = ProgressReward(gymnasium.make(IDENTIFIER, horizon=8))
    env.reset(options={"variation": 0})
    for _ in range(3):
        env.step(np.ones(8))
    state = env.unwrapped.get_state()
    other = ProgressReward(gymnasium.make(IDENTIFIER, horizon=8))
    other.reset(options={"variation": 1})
    _, start = other.reset(options={"state": state})
    found, end = rewards(other, 0)
    assert len(found) == 5
    assert found.sum() == pytest.approx(end - start["normalized_performance"], abs=1e-14)
