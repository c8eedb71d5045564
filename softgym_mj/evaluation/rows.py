"""Episodes of policies that look at observations alone, side by side on a device."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import dm_env
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.saved import SUFFIX
from softgym_mj.registry import find
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.make import make_place

MOST = 1056  # Episodes at once: more cost memory, and what is done is kept less often.


def check_policy(policy: str, device: str) -> None:
    """Raises `InvalidArgumentError` for a policy that looks at more than observations."""
    if policy not in ("random", "zero") and not policy.endswith(SUFFIX):
        valid = f"'cpu' for {policy!r}: it looks at one simulation"
        raise InvalidArgumentError("device", device, valid)


def play_rows(
    task: str,
    settings: Mapping[str, Any],
    policy: str,
    trust: bool,
    device: str,
    calls: Sequence[tuple[int, int]],
) -> list[dict]:
    """Plays episodes; returns the scores of each, as `running.play_episode`.

    Args:
        task, settings: task name and keyword arguments of it.
        policy, trust: as in `make_policy`.
        device: of `make_vec`, but not "cpu".
        calls: variation and seed of each.

    Raises:
        SimulationError: if an episode diverges.
    """
    arguments: dict[str, Any] = {"observation": "reduced", **settings}
    example = SoftGymEnv(find(task), split="all", **arguments)
    backend = BatchBackend(example, len(calls), make_place(device, len(calls)))
    envs = VectorEnv(backend, range(1), AutoresetMode.DISABLED)
    actor = example.dm_env.task.actor
    policies = []
    for variation, seed in calls:
        # All that these policies know of an environment.
        known: Any = SimpleNamespace(task=SimpleNamespace(actor=actor, variation=variation))
        policies.append(make_policy(policy, known, seed, trust=trust))
    kind, returns = dm_env.StepType.FIRST, np.zeros(len(calls))
    variations = [variation for variation, _ in calls]
    seen, _ = envs.reset(options={"variation": variations})
    ended = np.zeros(len(calls), bool)
    while not ended.any():
        rows = _rows(seen, example.observation_space)
        actions = [
            act(dm_env.TimeStep(kind, 0.0, 1.0, {name: array[i] for name, array in rows.items()}))
            for i, act in enumerate(policies)
        ]
        seen, rewards, terminated, truncated, infos = envs.step(np.array(actions, float))
        kind, returns = dm_env.StepType.MID, returns + _host(rewards)
        if _host(terminated).any():
            (first, *_) = np.flatnonzero(_host(terminated)).tolist()
            raise SimulationError(f"variation {variations[first]} of {task} has diverged")
        ended = _host(truncated)
    example.dm_env.reset(variations[0])
    quality = tuple(example.dm_env.task.last_quality)
    numbers = {
        name: _host(infos[name])
        for name in ("normalized_performance", "performance", "success", *quality)
    }
    envs.close()
    return [
        {
            "variation": variation,
            "seed": seed,
            **{name: numbers[name][i].item() for name in numbers if name not in quality},
            "return": returns[i].item(),
            "quality": {name: float(numbers[name][i]) for name in quality},
        }
        for i, (variation, seed) in enumerate(calls)
    ]


def _host(array: Any) -> np.ndarray:
    return np.asarray(array.cpu() if hasattr(array, "cpu") else array)


def _rows(seen: Any, space: spaces.Space) -> dict[str, np.ndarray]:
    """Observations by name, as arrays of NumPy."""
    named = seen if isinstance(space, spaces.Dict) else {"observation": seen}
    return {name: _host(array) for name, array in named.items()}
