"""Episodes of reactive experts, and their actions for batches of the states in these."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.factory import make_policy


def fast_or_all(variations, few):
    """Parameters (fidelity, variations): a few fast ones by default, all in the long run."""
    return pytest.mark.parametrize(
        ("fidelity", "variations"),
        [("fast", variations[:few]), pytest.param("default", variations, marks=pytest.mark.long)],
    )


def play(task, names, variations, **settings):
    """Plays an episode of each variation; returns environment, scores and states (n, size)."""
    env = softgym_mj.load(task, split=variations, observation=list(names), **settings)
    assert isinstance(env, Environment)
    scores, states = [], []
    for variation in variations:
        for step in env.play(make_policy("reactive", env), variation):
            states.append(np.concatenate([step.observation[name] for name in names]))
        scores.append(float(env.info()["normalized_performance"]))
    return env, scores, np.array(states)


def of_arms(points, centers, commanded, held=(0, 0)):
    """Returns "markov" of points and of two Franka arms, which hold what is in their hands."""
    senses, grips = np.zeros(38), np.column_stack([held, np.zeros((2, 3))])
    parts = (points, centers, senses, grips, commanded)
    return np.concatenate([np.ravel(part) for part in parts])


def entries(action):
    """Returns displacements (2, 3) as fractions of full speed, and grips (2,)."""
    action = action.reshape(2, 4)
    return action[:, :3], action[:, 3]


def check_batches(expert, states, atol):
    """Checks actions of batches, of tensors within `atol`; returns those of single states."""
    states = np.ascontiguousarray(states)
    single = np.array([expert(state) for state in states])
    np.testing.assert_array_equal(expert(states[None])[0], single)
    batch = expert(torch.tensor(states)[None])[0]
    np.testing.assert_allclose(batch, single, rtol=0, atol=atol)
    assert np.abs(single).max() <= 1.0
    return single
