"""Shirts of several cuts, of two layers, in a batch: its bits are those of the environment."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.policies.factory import make_policy

SETTINGS = {"observation": "full", "split": "all", "fidelity": "fast", "horizon": 30}
VARIATIONS = [811, 806]  # A T-shirt and a shirt with long sleeves.


def expert_actions(variation):
    """Actions of the scripted expert, which fold the first sleeve."""
    env = SoftGymEnv("fold_shirt", **SETTINGS)
    timestep, actions = env.dm_env.reset(variation), []
    expert = make_policy("scripted", env.dm_env)
    while not timestep.last():
        actions.append(np.asarray(expert(timestep), np.float32))
        timestep = env.dm_env.step(actions[-1].astype(float))
    return np.array(actions)


def test_rows_are_environments_with_a_cut_each():
    actions = np.stack([expert_actions(variation) for variation in VARIATIONS], axis=1)
    envs = softgym_mj.make_vec("fold_shirt", 2, device="host", **SETTINGS)
    starts, _ = envs.reset(seed=0, options={"variation": VARIATIONS})
    rows = [SoftGymEnv("fold_shirt", **SETTINGS) for _ in VARIATIONS]
    for env, variation, start in zip(rows, VARIATIONS, starts, strict=True):
        np.testing.assert_array_equal(env.reset(options={"variation": variation})[0], start)
    for both in actions:
        observations, rewards, *_ = envs.step(both)
        for i, env in enumerate(rows):
            observation, reward, *_ = env.step(both[i])
            np.testing.assert_array_equal(observations[i], observation)
            assert rewards[i] == pytest.approx(reward, rel=1e-12)
    for env in rows:
        assert env.dm_env.info()["normalized_performance"] > 0.1
        assert env.dm_env.task.shirt.points()[:, 2].max() > 0.02
    envs.close()
