"""`Expert`: a hand-written policy, an episode as a generator of actions."""

import abc
from collections.abc import Iterator

import dm_env
import numpy as np

from softgym_mj.environment import Environment


class Expert(abc.ABC):
    """Subclasses write an episode as a generator of actions."""

    def __init__(self, env: Environment):
        """Binds the expert to an environment of its task."""
        self._env = env
        self._plan = self._episode()

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """The action for a time step; the first of an episode clears the memory."""
        if timestep.first():
            self._plan = self._episode()
        return next(self._plan)

    @abc.abstractmethod
    def _episode(self) -> Iterator[np.ndarray]:
        """Endless actions of an episode."""
