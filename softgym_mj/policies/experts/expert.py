"""`Expert`: base class of scripted policies, which define an episode as a generator of actions."""

import abc
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError


class Expert(abc.ABC):
    """Scripted policy; subclasses define an episode as a generator of actions.

    Attributes:
        finished: Whether the generator of this episode has ended; the expert rests from then on.
    """

    def __init__(self, env: Environment):
        """Binds the expert to an environment of its task."""
        self._env = env
        self._begin()

    def _begin(self) -> None:
        self._plan, self.finished = self._episode(), False

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """Returns the action for a time step; the first time step starts a new episode."""
        if timestep.first():
            self._begin()
        action = next(self._plan, None)
        if action is None:
            self.finished, action = True, self._idle()
        return action

    @abc.abstractmethod
    def _episode(self) -> Iterator[np.ndarray]:
        """Yields the actions of an episode, until there is nothing left to do."""

    def _idle(self) -> np.ndarray:
        """Returns the action when there is nothing left to do."""
        return np.zeros(self._env.task.actor.action_size)


@runtime_checkable
class WithExpert(Protocol):
    """Protocol of custom tasks with an expert of their own."""

    def expert(self) -> Iterator[np.ndarray]:
        """Yields the actions (n,) in [-1, 1] of an episode.

        The generator may read the task between actions and must not end before the episode.
        """


class OwnExpert(Expert):
    """Expert of a task that implements `WithExpert`."""

    def _episode(self):
        task = self._env.task
        actions = task.expert()
        if not isinstance(actions, Iterator):
            valid = "a generator: a method that yields actions"
            raise InvalidArgumentError("expert()", actions, valid)
        for action in actions:
            yield np.asarray(action, float)
        raise InvalidArgumentError(
            f"`expert` of {type(task).__name__} yields too few actions: {self._env.name} lasts "
            f"{self._env.horizon} env steps"
        )


def smooth(progress: float) -> float:
    """Returns the fraction of the path after a fraction of the time of a minimum-jerk motion.

    The largest speed is 1.875 path lengths per duration, the largest acceleration 5.77 path lengths
    per squared duration.
    """
    s = min(max(progress, 0.0), 1.0)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
