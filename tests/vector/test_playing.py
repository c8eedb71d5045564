"""An episode in each environment; the oracle is one environment after the other."""

import numpy as np

import softgym_mj
from softgym_mj.vector.playing import play_each

TASK, SETTINGS, VARIATIONS = "straighten_rope", {"fidelity": "fast", "horizon": 4}, [3, 4, 5]


def chosen(first):
    """Actions (3, 8) that depend on the variation and on whether an episode has begun."""
    return 0.1 * np.outer(VARIATIONS, np.ones(8)) * np.where(first, 1.0, -1.0)[:, None]


def alone(i):
    """The return and the scores of the episode of environment `i`."""
    env = softgym_mj.load(TASK, split="all", **SETTINGS)
    steps = env.play(lambda timestep: chosen(np.full(3, timestep.first()))[i], VARIATIONS[i])
    total = 0.0  # Not by `sum`, which compensates rounding from Python 3.12 on.
    for timestep in steps:
        total += timestep.reward or 0.0
    return total, env.info()


def test_each_plays_as_it_does_alone():
    envs = softgym_mj.make_vec(TASK, 3, device="host", autoreset_mode="Disabled", **SETTINGS)
    found = play_each(envs, lambda seen, first: chosen(first), VARIATIONS)
    for i in range(3):
        total, info = alone(i)
        assert found["return"][i] == total
        for name in ("performance", "success", "variation", "diverged"):
            assert found[name][i] == info[name] and found[name].dtype == info[name].dtype
    envs.close()


def test_one_that_diverges_leaves_the_others_alone():
    envs = softgym_mj.make_vec(TASK, 3, device="host", autoreset_mode="Disabled", **SETTINGS)
    steps = []

    def act(seen, first):
        steps.append(first.tolist())
        if len(steps) == 2:
            envs.backend._physics._solver.qvel[1, 5] = np.inf
        return chosen(first & (len(steps) == 1))

    found = play_each(envs, act, VARIATIONS)
    # It starts again, for the others to go on, and what it does then is not counted.
    none = [False] * 3
    assert steps == [[True] * 3, none, [False, True, False], none]
    assert found["diverged"].tolist() == [False, True, False]
    assert found["physics_warnings"].tolist() == [0, 1, 0]
    for i in (0, 2):
        assert found["return"][i] == alone(i)[0]
    envs.close()
