"""Batched episodes, on a device, of policies that read only observations."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import dm_env
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.metrics import to_host
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.saved import SUFFIX
from softgym_mj.registry import find
from softgym_mj.rendering.observables import blank_images
from softgym_mj.tasks.shared.observations import names_of
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.make import make_device
from softgym_mj.vector.playing import play_each

MOST = 1056  # Episodes per batch; larger batches need more memory and are stored less often.


def check_policy(policy: str, device: str) -> None:
    """Raises `InvalidArgumentError` for a policy that reads more than observations."""
    if policy not in ("random", "zero") and not policy.endswith(SUFFIX):
        valid = f"'cpu' for {policy!r}, which reads the simulation state"
        raise InvalidArgumentError("device", device, valid)


def play_rows(
    task: str,
    settings: Mapping[str, Any],
    policy: str,
    trust: bool,
    device: str,
    calls: Sequence[tuple[int, int]],
    on_step: Callable[[int], None] = lambda step: None,
) -> list[dict]:
    """Plays episodes in a batch; returns the scores of each, as `running.play_episode` does.

    Args:
        task, settings: Task name and its keyword arguments.
        policy, trust: Arguments of `make_policy`.
        device: Device of `make_vec`, but not "cpu".
        calls: Variation and seed of each episode.
        on_step: Called before each env step with the number of env steps so far.

    Raises:
        SimulationError: if an episode diverges.
    """
    arguments: dict[str, Any] = {"observation": "reduced", **settings}
    example = SoftGymEnv(find(task), split="all", **arguments)
    backend = BatchBackend(example, len(calls), make_device(device, len(calls)))
    envs = VectorEnv(backend, range(1), AutoresetMode.DISABLED)
    actor = example.dm_env.task.actor
    policies = []
    for variation, seed in calls:
        # The part of an environment that these policies read.
        known: Any = SimpleNamespace(task=SimpleNamespace(actor=actor, variation=variation))
        policies.append(make_policy(policy, known, seed, trust=trust))

    steps = itertools.count()

    def act(seen: Any, first: np.ndarray) -> np.ndarray:
        on_step(next(steps))
        rows, actions = _rows(seen, example.observation_space, arguments["observation"]), []
        for i, choose in enumerate(policies):
            kind = dm_env.StepType.FIRST if first[i] else dm_env.StepType.MID
            own = {name: array[i] for name, array in rows.items()}
            actions.append(choose(dm_env.TimeStep(kind, 0.0, 1.0, own)))
        return np.array(actions, float)

    variations = [variation for variation, _ in calls]
    numbers = play_each(envs, act, variations)
    for i in np.flatnonzero(numbers["diverged"]).tolist():
        raise SimulationError(f"variation {variations[i]} of {task} has diverged")
    with blank_images():  # A machine that renders by the batch may lack OpenGL.
        example.dm_env.reset(variations[0])
    secondary = tuple(example.dm_env.task.last_secondary_metrics)
    envs.close()
    names = ("normalized_performance", "performance", "success", "return")
    return [
        {
            "variation": variation,
            "seed": seed,
            **{name: numbers[name][i].item() for name in names},
            "secondary_metrics": {name: float(numbers[name][i]) for name in secondary},
        }
        for i, (variation, seed) in enumerate(calls)
    ]


def _rows(
    seen: Any, space: spaces.Space, observation: str | Sequence[str]
) -> dict[str, np.ndarray]:
    """Returns observations by name, as arrays of NumPy."""
    named = seen if isinstance(space, spaces.Dict) else {names_of(observation)[0]: seen}
    return {name: to_host(array) for name, array in named.items()}
