"""Plays an episode in each environment of a `VectorEnv`."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softgym_mj.vector.base import VectorEnv


def to_host(array: Any) -> np.ndarray:
    """Returns an array (...) of NumPy, or a tensor on any device, as one of NumPy."""
    return np.asarray(array.cpu() if hasattr(array, "cpu") else array)


def play_each(
    envs: VectorEnv, act: Callable[[Any, np.ndarray], Any], variations: Sequence[int]
) -> dict[str, np.ndarray]:
    """Plays an episode of a variation in each environment.

    An episode that diverges ends before the others, and its environment starts again, uncounted.

    Args:
        envs: environments that do not reset themselves.
        act: gives actions for observations of all, and whether each is the first of an episode
            (num_envs,) bool.
        variations: of each.

    Returns:
        Scalars (num_envs,) of the infos at the end of each episode by name, and the undiscounted
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
