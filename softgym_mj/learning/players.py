"""`Players`: environments in which the best actions of a training's seeds are evaluated."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from softgym_mj.learning.learner import Problem, worlds_of

Act = Callable[[Any, Tensor, Any], tuple[Tensor, Any]]


class Players:
    """Environments by their number, made when they are first needed."""

    def __init__(self, problem: Problem, make: Callable[[int], Any], told: Callable[[Tensor], Any]):
        """Notes how environments are made.

        Args:
            problem: what is learned.
            make: makes a number of environments, which reset only when they are told to.
            told: makes of actions (seeds, n, action) what environments take.
        """
        self._problem, self._make, self._told = problem, make, told
        self._made: dict[int, Any] = {}

    def play(self, variations: Sequence[int], act: Act) -> dict[str, np.ndarray]:
        """Plays an episode of each variation with each seed.

        Args:
            variations: indices.
            act: gives actions (seeds, n, action), and what it remembers, of observations, whether
                each is the first of an episode (seeds, n), and what it remembers.

        Returns:
            Numbers (seeds, variations) of the infos at the end, by name.
        """
        seeds = len(self._problem.seeds)
        number = len(variations) * seeds
        if number not in self._made:
            self._made[number] = self._make(number)
        envs, each = self._made[number], [*variations] * seeds
        seen, _ = envs.reset(options={"variation": each})
        first, done, memory = np.ones(number, bool), np.zeros(number, bool), None
        found: dict[str, np.ndarray] = {}
        while not done.all():
            action, memory = act(
                worlds_of(self._problem, seen), worlds_of(self._problem, first), memory
            )
            seen, _, terminated, truncated, infos = envs.step(self._told(action))
            first = np.asarray(torch.as_tensor(terminated | truncated).cpu())
            fresh, done = first & ~done, done | first
            if fresh.any():
                for name, values in infos.items():
                    if not (name.startswith("_") or isinstance(values, dict)):
                        array = np.asarray(torch.as_tensor(values).cpu(), float)
                        kept = found.setdefault(name, np.zeros(number))
                        kept[fresh] = array[fresh]
            if first.any() and not done.all():  # What has diverged ends before the others.
                options = {"reset_mask": first, "variation": each}
                seen, _ = envs.reset(options=options)
        return {name: values.reshape(seeds, -1) for name, values in found.items()}

    def close(self) -> None:
        """Closes all environments."""
        for envs in self._made.values():
            envs.close()
