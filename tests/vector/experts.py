"""Episodes of scripted experts, as oracles of batches that take the same actions."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.policies.factory import make_policy


def expert_episode(task, variation, **settings):
    """Plays an episode, observed in full, with actions that are rounded to float32.

    Returns:
        Environment at the end, actions (steps, size) float32, and observation and reward of each
        time step, from the reset on.
    """
    env, actions = SoftGymEnv(task, **settings), []
    expert = make_policy("scripted", env.dm_env)

    def act(timestep):
        actions.append(np.asarray(expert(timestep), np.float32))
        return actions[-1].astype(float)

    played = [
        (timestep.observation["full"].astype(np.float32), timestep.reward)
        for timestep in env.dm_env.play(act, variation)
    ]
    return env, np.array(actions), played


def check_rows(task, variations, episodes, **settings):
    """Checks that a batch has the bits of `expert_episode` of each variation; returns rewards."""
    envs = softgym_mj.make_vec(task, len(variations), device="host", **settings)
    starts, _ = envs.reset(seed=0, options={"variation": variations})
    for start, (_, _, played) in zip(starts, episodes, strict=True):
        np.testing.assert_array_equal(start, played[0][0])
    for k, actions in enumerate(zip(*(actions for _, actions, _ in episodes), strict=True), 1):
        observations, rewards, *_ = envs.step(np.stack(actions))
        for i, (_, _, played) in enumerate(episodes):
            np.testing.assert_array_equal(observations[i], played[k][0])
            assert rewards[i] == pytest.approx(played[k][1], rel=1e-12)
    envs.close()
    return rewards
