"""Plays episodes of a dataset and returns them as arrays by name."""

import functools
import json
from collections.abc import Callable, Mapping
from typing import Any

import dm_env
import gymnasium
import numpy as np

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import SimulationError
from softgym_mj.policies.factory import Policy, make_policy
from softgym_mj.policies.rollouts import received
from softgym_mj.recording.noise import disturbance
from softgym_mj.registry import TaskRecord

_BETWEEN = "/"  # Separator in the names of arrays: "infos/success".
LABEL = "expert_action"  # Name of the info with the policy's own action, without noise.
RESTING = 0.01  # [m/s] SoftGym's threshold for ropes and piles at rest.
LABELS = f"infos{_BETWEEN}{LABEL}"  # Array of these actions over time.


def play(
    env: gymnasium.Env,
    act: Policy,
    variation: int,
    until: Callable[[dict], bool] = lambda _: False,
    disturb: Callable[[np.ndarray], np.ndarray] | None = None,
) -> dict[str, np.ndarray]:
    """Plays an episode of n env steps.

    Minari's own collector does the same, but requires JAX.

    Args:
        env: The environment; its observation is an array or a dict.
        act: The policy.
        variation: Index 0..999.
        until: Maps an info to whether the episode is truncated there.
        disturb: Maps the policy's action to the applied one; None applies it unchanged.

    Returns:
        Arrays over time by name: applied "actions" (n, size); "rewards", "terminations" and
        "truncations" (n,); "observations" and "infos" (n + 1, ...), whose entries are named as
        "infos/success" or "infos/cameras/left/intrinsics". With `disturb` also `LABELS` (n, size),
        the policy's own actions.

    Raises:
        SimulationError: if the episode diverges.
    """
    observation, info = env.reset(options={"variation": variation})
    timestep = dm_env.restart(_named(observation))
    observations, infos, steps, ended = [observation], [info], [], False
    own = []
    while not ended:
        own.append(act(timestep).astype(env.action_space.dtype))
        action = own[-1] if disturb is None else disturb(own[-1])
        observation, reward, terminated, truncated, info = env.step(action)
        if info["diverged"]:
            raise SimulationError(f"variation {variation} has diverged: it cannot be recorded")
        truncated = truncated or (until(info) and not terminated)
        timestep = dm_env.transition(reward, _named(observation))
        observations.append(observation)
        infos.append(info)
        steps.append((action, reward, terminated, truncated))
        ended = terminated or truncated
    names = "actions", "rewards", "terminations", "truncations"
    played = zip(names, map(np.array, zip(*steps, strict=True)), strict=True)
    seen = _over_time("observations", observations)
    labels = {} if disturb is None else {LABELS: np.array(own)}
    return {**dict(played), **seen, **_over_time("infos", infos), **labels}


def _over_time(part: str, values: list) -> dict[str, np.ndarray]:
    """Stacks values over time: to one array, or to one for each name."""
    if not isinstance(values[0], dict):
        return {part: np.array(values)}
    over_time: dict[str, np.ndarray] = {}
    for name in values[0]:
        over_time |= _over_time(f"{part}{_BETWEEN}{name}", [value[name] for value in values])
    return over_time


def _named(observation) -> dict:
    """Returns an observation as a dict, as policies expect it."""
    return observation if isinstance(observation, dict) else {"observation": observation}


def nested(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Returns the arrays of `play` as keyword arguments of Minari, with nested dicts."""
    episode: dict[str, Any] = {}
    for key, value in arrays.items():
        *parts, name = key.split(_BETWEEN)
        inner = episode
        for part in parts:
            inner = inner.setdefault(part, {})
        inner[name] = value
    return episode


def played(
    task: TaskRecord | bytes,
    settings: str,
    policy: str,
    seed: int,
    trust: bool,
    idle: str,
    noise: float,
    variation: int,
) -> dict[str, np.ndarray]:
    """Plays an episode in any process and returns its arrays, as `play` does.

    Args:
        task: Value of `policies.rollouts.sent_to`.
        settings: Keyword arguments of the environment as JSON.
        policy, seed, trust, idle, noise: Arguments of `recording.record`.
        variation: Index 0..999.
    """
    env = _environment(task, settings)
    # A new policy for each episode: it cannot depend on earlier ones.
    act = make_policy(policy, env.dm_env, seed, trust=trust)
    disturb = disturbance(env.dm_env.task.actor, noise, seed, variation)

    def finished() -> bool:
        return getattr(act, "finished", False)  # Only experts have this attribute.

    def at_rest(info: dict) -> bool:
        # Water has no `max_speed`.
        return idle == "drop" and finished() and info.get("max_speed", 0.0) < RESTING

    def disturbed(action: np.ndarray) -> np.ndarray:
        # An expert that has finished would not correct the noise.
        return action if finished() else disturb(action)

    return play(env, act, variation, at_rest, disturbed if noise else None)


@functools.lru_cache(maxsize=1)
def _environment(task: TaskRecord | bytes, settings: str) -> SoftGymEnv:
    """Returns this process's cached environment of a task."""
    return SoftGymEnv(received(task), split="all", **json.loads(settings))
