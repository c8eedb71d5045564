"""Goals that are drawn anew in each variation: read off a state, reached by one, and compared.

A task whose goal is drawn names its `Goals` as `Task.goals`; goals of others are fixed, or follow
from where the cloth lies at the start.
"""

import abc
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State


class Goals(abc.ABC):
    """Goals of a task, as functions of arrays.

    A goal is a dict of arrays as `Task.goal` returns it, or the numbers (..., k) by which a reward
    compares what is achieved with what is desired.

    Attributes:
        task: whose.
    """

    def __init__(self, task: Any):
        self.task = task

    @abc.abstractmethod
    def read(self, full: Array) -> tuple[State, Episode]:
        """What `measure` and `reduced` need, of full states (..., n): the observation "full"."""

    @abc.abstractmethod
    def reached(self, state: State, episode: Episode) -> dict[str, Array]:
        """The goal that this state reaches: its reward is the highest there is."""

    @abc.abstractmethod
    def achieved(self, state: State, episode: Episode) -> Array:
        """What a reward compares (..., k) with `desired`."""

    @abc.abstractmethod
    def desired(self, state: State, episode: Episode) -> Array:
        """The goal of the episode (..., k)."""

    @abc.abstractmethod
    def reward(self, achieved: Array, desired: Array) -> Array:
        """The task's rewards (...) of states by both (..., k)."""


def goals(name: str, task: Any) -> Goals:
    """Those of a task by its name.

    Raises:
        InvalidArgumentError: for a task whose goal is the same in all variations, or an actor that
            the full state does not describe.
    """
    if task.goals is None:
        raise InvalidArgumentError("task", name, "one that draws its goal: whose class has `goals`")
    return task.goals(task)


def depends_on_goal(task: Any, name: str) -> np.ndarray:
    """Which numbers (n,) of an observation of `STATES` are the goal's."""
    state, episode = task.state(), task.episode
    elsewhere = {key: value + 1.0 for key, value in episode.goal.items()}
    other = Episode(**{**vars(episode), "goal": elsewhere})
    seen, moved = (STATES[name].value(task, state, each) for each in (episode, other))
    return seen != moved


def as_points(numbers: Array) -> Array:
    """Numbers (..., 3 n) as points (..., n, 3)."""
    return numbers.reshape((*numbers.shape[:-1], numbers.shape[-1] // 3, 3))
