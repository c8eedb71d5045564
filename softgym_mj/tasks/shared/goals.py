"""Goals drawn in each variation, as numbers that the reward compares with what is achieved.

A task whose goal is drawn sets `Task.goals` to its `Goals`. The goals of other tasks are fixed, or
follow from the start state.
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

    Attributes:
        task: the task.
    """

    def __init__(self, task: Any):
        self.task = task

    @abc.abstractmethod
    def achieved(self, state: State, episode: Episode) -> Array:
        """Returns the achieved goal (..., k), which `reward` compares with `desired`."""

    @abc.abstractmethod
    def desired(self, state: State, episode: Episode) -> Array:
        """Returns the goal of the episode (..., k)."""

    @abc.abstractmethod
    def reward(self, achieved: Array, desired: Array) -> Array:
        """Returns the task's rewards (...) for achieved and desired goals (..., k)."""


def goals(name: str, task: Any) -> Goals:
    """Returns the `Goals` of a task.

    Args:
        name: name of the task.
        task: the task.

    Raises:
        InvalidArgumentError: for a task whose goal is the same in all variations.
    """
    if task.goals is None:
        raise InvalidArgumentError("task", name, "a task whose class defines `goals`")
    return task.goals(task)


def depends_on_goal(task: Any, name: str) -> np.ndarray:
    """Returns which numbers (n,) of an observation of `STATES` depend on the goal."""
    state, episode = task.state(), task.episode
    elsewhere = {key: value + 1.0 for key, value in episode.goal.items()}
    other = Episode(**{**vars(episode), "goal": elsewhere})
    seen, moved = (STATES[name].value(task, state, each) for each in (episode, other))
    return seen != moved
