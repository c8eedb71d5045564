"""Shirts of several cuts, of two layers, in a batch: its bits are those of the environment."""

from tests.vector.experts import check_rows, expert_episode

SETTINGS = {"observation": "full", "split": "all", "fidelity": "fast", "horizon": 30}
VARIATIONS = [811, 806]  # A T-shirt and a shirt with long sleeves.


def test_rows_are_environments_with_a_cut_each():
    episodes = [expert_episode("fold_shirt", variation, **SETTINGS) for variation in VARIATIONS]
    check_rows("fold_shirt", VARIATIONS, episodes, **SETTINGS)
    for env, *_ in episodes:  # The experts have folded the first sleeve.
        assert env.dm_env.info()["normalized_performance"] > 0.1
        assert env.dm_env.task.shirt.points()[:, 2].max() > 0.02
