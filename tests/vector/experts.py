"""Episodes of scripted experts, as oracles of batches that take the same actions."""

import numpy as np

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
