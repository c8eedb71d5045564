"""Shirts of several cuts, of two layers, in a batch: its bits are those of the environment."""

import numpy as np
import pytest

import softgym_mj
from tests.vector.experts import expert_episode

SETTINGS = {"observation": "full", "split": "all", "fidelity": "fast", "horizon": 30}
VARIATIONS = [811, 806]  # A T-shirt and a shirt with long sleeves.


def test_rows_are_environments_with_a_cut_each():
    episodes = [expert_episode("fold_shirt", variation, **SETTINGS) for variation in VARIATIONS]
    envs = softgym_mj.make_vec("fold_shirt", 2, device="host", **SETTINGS)
    starts, _ = envs.reset(seed=0, options={"variation": VARIATIONS})
    for start, (_, _, played) in zip(starts, episodes, strict=True):
        np.testing.assert_array_equal(start, played[0][0])
    for k, both in enumerate(zip(*(actions for _, actions, _ in episodes), strict=True), 1):
        observations, rewards, *_ = envs.step(np.stack(both))
        for i, (_, _, played) in enumerate(episodes):
            np.testing.assert_array_equal(observations[i], played[k][0])
            assert rewards[i] == pytest.approx(played[k][1], rel=1e-12)
    for env, *_ in episodes:  # The experts have folded the first sleeve.
        assert env.dm_env.info()["normalized_performance"] > 0.1
        assert env.dm_env.task.shirt.points()[:, 2].max() > 0.02
    envs.close()
