"""`Players`: the environments in which the policies of a training are evaluated."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from torch import Tensor

from softgym_mj.learning.learner import Problem, split_by_seed
from softgym_mj.vector.playing import play_each

Act = Callable[[Any, Tensor, Any], tuple[Tensor, Any]]


class Players:
    """Evaluation environments, created when they are first needed."""

    def __init__(
        self, problem: Problem, make: Callable[[int], Any], env_actions: Callable[[Tensor], Any]
    ):
        """Sets how environments are created.

        Args:
            problem: Learning problem.
            make: Creates a vector environment of a number of environments, without autoreset.
            env_actions: Converts actions (seeds, n, action) to those of the vector environment.
        """
        self._problem, self._make, self._env_actions = problem, make, env_actions
        self._made: dict[int, Any] = {}

    def play(self, variations: Sequence[int], act: Act) -> dict[str, np.ndarray]:
        """Plays an episode of each variation with each seed.

        Args:
            variations: Indices of the variations.
            act: Maps observations, whether each is the first of an episode (seeds, n), and its
                memory to actions (seeds, n, action) and the next memory.

        Returns:
            Infos at the end of episodes, and the "return" (seeds, variations), by name.
        """
        seeds = len(self._problem.seeds)
        number = len(variations) * seeds
        if number not in self._made:
            self._made[number] = self._make(number)
        memory = None

        def chosen(seen: Any, first: np.ndarray) -> Any:
            nonlocal memory
            action, memory = act(
                split_by_seed(self._problem, seen), split_by_seed(self._problem, first), memory
            )
            return self._env_actions(action)

        result = play_each(self._made[number], chosen, [*variations] * seeds)
        return {name: values.astype(float).reshape(seeds, -1) for name, values in result.items()}

    def close(self) -> None:
        """Closes all environments."""
        for envs in self._made.values():
            envs.close()
