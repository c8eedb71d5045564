"""Episodes of a dataset: played, and as arrays by name."""

from collections.abc import Mapping
from typing import Any

import dm_env
import gymnasium
import numpy as np

from softgym_mj.policies.factory import Policy

_BETWEEN = "/"  # Part and name of an array: "infos/success".


def play(env: gymnasium.Env, act: Policy, variation: int) -> dict[str, Any]:
    """What happens in an episode of n env steps.

    Minari's own collector does the same, but needs JAX for it.

    Args:
        env: where; its observations are named or not.
        act: the policy.
        variation: index 0..999.

    Returns:
        Arrays over time by name: "observations" and "infos" (n + 1, ...), by names of their own if
        they have such; "actions" (n, size), "rewards", "terminations" and "truncations" (n,).
    """
    observation, info = env.reset(options={"variation": variation})
    timestep = dm_env.restart(_named(observation))
    observations, infos = [observation], [info]
    steps: dict[str, list] = {"actions": [], "rewards": [], "terminations": [], "truncations": []}
    while not (steps["truncations"] and (steps["truncations"][-1] or steps["terminations"][-1])):
        action = act(timestep).astype(env.action_space.dtype)
        observation, *outcome, info = env.step(action)
        timestep = dm_env.transition(outcome[0], _named(observation))
        observations.append(observation)
        infos.append(info)
        for values, value in zip(steps.values(), (action, *outcome), strict=True):
            values.append(value)
    played = {name: np.array(values) for name, values in steps.items()}
    return {**played, "observations": _over_time(observations), "infos": _over_time(infos)}


def _over_time(values: list) -> np.ndarray | dict[str, np.ndarray]:
    """Arrays, or dicts of them, with time as a further axis."""
    if not isinstance(values[0], dict):
        return np.array(values)
    return {name: np.array([value[name] for value in values]) for name in values[0]}


def _named(observation) -> dict:
    """An observation as policies get it."""
    return observation if isinstance(observation, dict) else {"observation": observation}


def flat(episode: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """The arrays of an episode by one name each, as a store takes them: "infos/success"."""
    arrays: dict[str, np.ndarray] = {}
    for part, values in episode.items():
        if isinstance(values, dict):
            arrays |= {f"{part}{_BETWEEN}{name}": value for name, value in values.items()}
        else:
            arrays[part] = values
    return arrays


def nested(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """What `flat` was made of."""
    episode: dict[str, Any] = {}
    for key, value in arrays.items():
        part, _, name = key.partition(_BETWEEN)
        if name:
            episode.setdefault(part, {})[name] = value
        else:
            episode[part] = value
    return episode
