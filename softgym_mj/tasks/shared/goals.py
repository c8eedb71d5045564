"""Goals that are drawn anew in each variation: read off a state, reached by one, and compared.

RopeConfiguration draws a letter and PourWaterAmount a share of the water. The goals of the other
tasks are fixed, or follow from where the cloth lies at the start.
"""

import abc
from typing import Any

import numpy as np

from softgym_mj import metrics
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array, namespace
from softgym_mj.tasks.shared import pouring
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.state import Episode, State

_HALF = 0.5  # Of a particle: a share between two whole numbers of them counts as the lower one.
_CUP = 6  # Numbers of a cup in the full state: `entries.cup`.


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


class RopeGoals(Goals):
    """Where the vertices ought to lie, from either end: k = 3 n [m]."""

    def read(self, full: Array) -> tuple[State, Episode]:
        """See `Goals`."""
        end = 3 * self.task.max_points
        return self._made(full[..., :end], full[..., end : 2 * end], full[..., 2 * end :])

    def _made(self, rope: Array, goal: Array, sensed: Array) -> tuple[State, Episode]:
        points, places = _points(rope), _points(goal)
        there = namespace(points).ones_like(points[..., 0]) > 0
        state = State({"rope": points}, {"rope": there}, {}, sensed, sensed[..., :0])
        return state, Episode(0, {}, {"rope": {}}, {"rope": places}, 0.0)

    def reached(self, state: State, episode: Episode) -> dict[str, Array]:
        """See `Goals`."""
        return dict(state.points)

    def achieved(self, state: State, episode: Episode) -> Array:
        """See `Goals`."""
        return metrics.flat(state.points["rope"])

    def desired(self, state: State, episode: Episode) -> Array:
        """See `Goals`."""
        return metrics.flat(episode.goal["rope"])

    def reward(self, achieved: Array, desired: Array) -> Array:
        """See `Goals`."""
        return self.task.measure(*self._made(achieved, desired, achieved[..., :0])).reward


class PourGoals(Goals):
    """The share of the water that ought to be poured, in whole particles: k = 1."""

    def __init__(self, task: Any):
        super().__init__(task)
        if task.actor.name != "cup":
            raise InvalidArgumentError("actor", task.actor.name, "'cup', whose full state has all")
        self._walls = {"cup": task.cup.size.wall, "target": task.target.size.wall}  # In all alike.

    def read(self, full: Array) -> tuple[State, Episode]:
        """See `Goals`."""
        end = 3 * self.task.max_points
        water = _points(full[..., :end])
        xp = namespace(full)
        poses, shapes = {}, {}
        for k, (name, wall) in enumerate(self._walls.items()):
            x, z, angle, *size = (full[..., end + _CUP * k + i] for i in range(_CUP))
            none, half = xp.zeros_like(x), angle / 2
            turn = xp.cos(half), none, xp.sin(half), none  # About +Y.
            poses[name] = metrics.columns(x, none, z, *turn, angle)
            shapes[name] = {"size": metrics.columns(*size, xp.ones_like(x) * wall)}
        level, share = (full[..., end + _CUP * len(self._walls) + i] for i in range(2))
        nothing = full[..., :0]
        state = State(
            {"water": water}, {"water": xp.any(water != 0, axis=-1)}, poses, nothing, nothing
        )
        return state, Episode(0, {}, shapes, {"level": level, "share": share}, 0.0)

    def reached(self, state: State, episode: Episode) -> dict[str, Array]:
        """See `Goals`."""
        number, before = state.present["water"].sum(axis=-1), episode.goal
        share = self.achieved(state, episode)[..., 0] + _HALF / number
        floor = episode.shapes["target"]["size"][..., 3] / 2
        # The bar is as far above the target's floor as the share is large: `PourWaterAmount.goal`.
        return {
            "level": floor + share * (before["level"] - floor) / before["share"],
            "share": share,
        }

    def achieved(self, state: State, episode: Episode) -> Array:
        """See `Goals`."""
        return pouring.fractions(state, episode)["poured"][..., None]

    def desired(self, state: State, episode: Episode) -> Array:
        """See `Goals`."""
        number = state.present["water"].sum(axis=-1)
        return (number * episode.goal["share"] // 1 / number)[..., None]

    def reward(self, achieved: Array, desired: Array) -> Array:
        """See `Goals`; `PourWaterAmount.measure` counts particles to get here."""
        return -abs(desired - achieved)[..., 0]


_OF_TASKS: dict[str, type[Goals]] = {
    "rope_configuration": RopeGoals,
    "pour_water_amount": PourGoals,
}


def goals(name: str, task: Any) -> Goals:
    """Those of a task by its name.

    Raises:
        InvalidArgumentError: for a task whose goal is the same in all variations, or an actor that
            the full state does not describe.
    """
    if name not in _OF_TASKS:
        raise InvalidArgumentError("task", name, f"one that draws its goal: {[*_OF_TASKS]}")
    return _OF_TASKS[name](task)


def depends_on_goal(task: Any, name: str) -> np.ndarray:
    """Which numbers (n,) of an observation of `STATES` are the goal's."""
    state, episode = task.state(), task.episode
    elsewhere = {key: value + 1.0 for key, value in episode.goal.items()}
    other = Episode(**{**vars(episode), "goal": elsewhere})
    seen, moved = (STATES[name].value(task, state, each) for each in (episode, other))
    return seen != moved


def _points(numbers: Array) -> Array:
    """Numbers (..., 3 n) as points (..., n, 3)."""
    return numbers.reshape((*numbers.shape[:-1], numbers.shape[-1] // 3, 3))
