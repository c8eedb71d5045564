"""Plays an episode in each environment of a `VectorEnv`."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softgym_mj.metrics import to_host
from softgym_mj.vector.base import VectorEnv


def play_each(
    envs: VectorEnv, act: Callable[[Any, np.ndarray], Any], variations: Sequence[int]
) -> dict[str, np.ndarray]:
    """Plays one episode of a variation in each environment.

    An episode that diverges ends early; its environment then restarts and is not counted again.

    Args:
        envs: Environments without automatic resets.
        act: Returns actions from observations and from flags of first steps (num_envs,) bool.
        variations: Variation of each environment.

    Returns:
        Scalars (num_envs,) by name: infos at the end of each episode, and the undiscounted
        "return".
    """
    number, each = len(variations), [*variations]
    seen, _ = envs.reset(options={"variation": each})
    first, done, returns = np.ones(number, bool), np.zeros(number, bool), np.zeros(number)
    found: dict[str, np.ndarray] = {}
    while not done.all():
        seen, rewards, terminated, truncated, infos = envs.step(act(seen, first))
        returns += np.where(done, 0.0, to_host(rewards))
        first = to_host(terminated | truncated)
        fresh, done = first & ~done, done | first
        if fresh.any():
            for name, values in infos.items():
                if not (name.startswith("_") or isinstance(values, dict)):
                    array = to_host(values)
                    found.setdefault(name, np.zeros(number, array.dtype))[fresh] = array[fresh]
        if first.any() and not done.all():
            seen, _ = envs.reset(options={"reset_mask": first, "variation": each})
    return found | {"return": returns}
