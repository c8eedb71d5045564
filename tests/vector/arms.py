"""Checks of arms in batches against arms in environments."""

from collections.abc import Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.policies.experts import make_policy
from softgym_mj.vector.base import VectorEnv
from tests.vector.same import same


def recorded(env: Environment, variations: Sequence[int]) -> list[tuple[list, list]]:
    """Returns an expert's episodes: actions, and observations and infos, of each variation."""
    found = []
    for variation in variations:
        timestep = env.reset(variation)
        policy, actions, seen = make_policy(env), [], [(timestep.observation, env.info())]
        while not timestep.last():
            actions.append(policy(timestep))
            timestep = env.step(actions[-1])
            seen.append((timestep.observation, env.info()))
        found.append((actions, seen))
    return found


def check_snapshots(envs: VectorEnv, alone: SoftGymEnv, actions: np.ndarray, atol: float) -> None:
    """Checks that snapshots of a batch that was reset continue in an environment and back.

    Args:
        envs: Three environments, observed in full and as "markov"; they are closed.
        alone: Environment of the same task and settings.
        actions: Eight actions of the batch.
        atol: Largest difference of an observation.
    """
    for each in actions[:4]:
        envs.step(each)
    states = envs.get_state()
    later = [envs.step(each)[0] for each in actions[4:]]
    observation, _ = alone.set_state(states[1])
    for k, each in enumerate(actions[4:]):
        if k == 2:
            middle = alone.get_state()
        observation = alone.step(each[1])[0]
        for name in ("full", "markov"):
            np.testing.assert_allclose(observation[name], later[k][name][1], atol=atol)
    envs.set_state(states)
    again = [envs.step(each)[0] for each in actions[4:]]
    assert same(later, again)
    envs.set_state([middle] * 3)
    for k in (2, 3):
        observations = envs.step(np.tile(actions[4 + k][1], (3, 1)))[0]
        for name in ("full", "markov"):
            np.testing.assert_allclose(observations[name][2], later[k][name][1], atol=atol)
    envs.close()
