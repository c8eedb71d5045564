"""State of a task's scene, and constants of an episode.

Leading dimensions `...` are () for one simulation and (num_envs,) for a batch; arrays are NumPy's
or PyTorch's.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Never

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array


class Named(dict[str, Any]):
    """Arrays by name.

    Raises:
        InvalidArgumentError: for an unknown name, or arrays without names.
    """

    def __init__(self, title: str, arrays: Mapping[str, Any]):
        """Copies `arrays`; `title` names them in messages."""
        if not isinstance(arrays, Mapping):
            raise InvalidArgumentError(title, arrays, "a dict from names to arrays")
        super().__init__(arrays)
        self._title = title

    def __missing__(self, name: object) -> Never:
        raise InvalidArgumentError(self._title, name, tuple(self) or "no name, because it is empty")


class State(NamedTuple):
    """State of a scene.

    Attributes:
        points: (..., n, 3) [m] of each object that deforms or flows, by name.
        present: (..., n) bool, by the same names: False for padding in a batch.
        poses: (..., 8) of each cup by name: x, y, z [m], quaternion (w, x, y, z), and the unwrapped
            angle about +Y [rad].
        sensed: (..., k) proprioception of the actor.
        remembered: (..., m) internal state of the actor: grips, commands, a cup's velocity.
    """

    points: dict[str, Array]
    present: dict[str, Array]
    poses: dict[str, Array]
    sensed: Array
    remembered: Array

    @classmethod
    def stack(cls, states: Sequence["State"]) -> "State":
        """Stacks states of one task along a new first dimension, padded (NumPy)."""
        return cls(*(stack(values) for values in zip(*states, strict=True)))

    def row(self, index: int) -> "State":
        """Returns one state of a batch."""
        return State(*(row(values, index) for values in self))


@dataclasses.dataclass(frozen=True)
class Episode:
    """Constants of an episode.

    Attributes:
        variation: (...) index.
        points: (..., n, 3) [m] of each object at the start, by name.
        shapes: arrays by name that depend on the size of an object, by its name.
        goal: arrays by name, as `Task.goal` returns them.
        initial_performance: (...) performance at the start.
    """

    variation: Array
    points: dict[str, Array]
    shapes: dict[str, dict[str, Array]]
    goal: dict[str, Array]
    initial_performance: Array

    @classmethod
    def stack(cls, episodes: Sequence["Episode"]) -> "Episode":
        """Stacks episodes of one task along a new first dimension, padded with zeros (NumPy)."""
        return cls(*(stack(values) for values in zip(*map(_fields, episodes), strict=True)))

    def row(self, index: int) -> "Episode":
        """Returns one episode of a batch."""
        return Episode(*(row(values, index) for values in _fields(self)))


def _fields(episode: Episode) -> tuple:
    return tuple(getattr(episode, field.name) for field in dataclasses.fields(episode))


def stack(values: Sequence) -> Array:
    """Stacks arrays of any sizes, or dicts of them, padded with zeros."""
    if isinstance(values[0], dict):
        return {key: stack([value[key] for value in values]) for key in values[0]}
    arrays = [np.asarray(value) for value in values]
    largest = np.max([array.shape for array in arrays], axis=0).astype(int)
    whole = np.zeros((len(arrays), *largest), arrays[0].dtype)
    for i, array in enumerate(arrays):
        whole[i, ...][tuple(slice(size) for size in array.shape)] = array
    return whole


def row(values: Any, index: int) -> Any:
    """Returns a row of an array, or of those of dicts of them."""
    if isinstance(values, dict):
        return {name: row(value, index) for name, value in values.items()}
    return values[index]
