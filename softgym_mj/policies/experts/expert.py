"""`Expert`: a hand-written policy, an episode as a generator of actions."""

import abc
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError


class Expert(abc.ABC):
    """Subclasses write an episode as a generator of actions.

    Attributes:
        finished: whether it has come to the end of these in this episode and only rests.
    """

    def __init__(self, env: Environment):
        """Binds the expert to an environment of its task."""
        self._env = env
        self._begin()

    def _begin(self) -> None:
        self._plan, self.finished = self._episode(), False

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """The action for a time step; the first of an episode clears the memory."""
        if timestep.first():
            self._begin()
        action = next(self._plan, None)
        if action is None:
            self.finished, action = True, self._idle()
        return action

    @abc.abstractmethod
    def _episode(self) -> Iterator[np.ndarray]:
        """Actions of an episode, until there is nothing left to do."""

    def _idle(self) -> np.ndarray:
        """The action when there is nothing left to do."""
        return np.zeros(self._env.task.actor.action_size)


@runtime_checkable
class WithExpert(Protocol):
    """A task that brings its own expert, as custom tasks may: any class with this method."""

    def expert(self) -> Iterator[np.ndarray]:
        """The actions (n,) in [-1, 1] of an episode, from its start on.

        A generator that looks at the task between two actions and yields at least as many as the
        episode has env steps.
        """


class OwnExpert(Expert):
    """The expert that a task brings."""

    def _episode(self):
        task = self._env.task
        for action in task.expert():
            yield np.asarray(action, float)
        raise InvalidArgumentError(
            f"`expert` of {type(task).__name__} yields too few actions: {self._env.name} lasts "
            f"{self._env.horizon} env steps"
        )


def smooth(progress: float) -> float:
    """Fraction of the way after a fraction of the time, with the least jerk from rest to rest.

    The largest speed is 1.875 ways per duration, the largest acceleration 5.77 per its square.
    """
    s = min(max(progress, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
