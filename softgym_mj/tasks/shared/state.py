"""What a task measures: the state of its scene, and what stays the same in an episode.

Leading dimensions `...` are () for one simulation and (num_envs,) for a batch; arrays are NumPy's
or PyTorch's.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from softgym_mj.metrics import Array


class State(NamedTuple):
    """The state of a scene.

    Attributes:
        points: (..., n, 3) [m] of each object that deforms or flows, by name.
        present: (..., n) bool, by the same names: False where a batch pads.
        poses: (..., 8) of each cup by name: x, y, z [m], quaternion (w, x, y, z), and the angle
            about +Y [rad], which is known beyond half a turn.
        sensed: (..., k) what the actor senses of itself.
        remembered: (..., m) what else decides on its next steps: grips, commands, a cup's velocity.
    """

    points: dict[str, Array]
    present: dict[str, Array]
    poses: dict[str, Array]
    sensed: Array
    remembered: Array

    @classmethod
    def stack(cls, states: Sequence["State"]) -> "State":
        """States of one task as one with a leading dimension, padded (NumPy)."""
        return cls(*(stack(values) for values in zip(*states, strict=True)))


@dataclasses.dataclass(frozen=True)
class Episode:
    """What an episode starts with and does not change.

    Attributes:
        variation: (...) index.
        points: (..., n, 3) [m] of each object at the start, by name.
        shapes: what depends on the size of an object, by its name: arrays by name.
        goal: arrays by name, as `Task.goal` returns them.
        initial_performance: (...) at the start.
    """

    variation: Array
    points: dict[str, Array]
    shapes: dict[str, dict[str, Array]]
    goal: dict[str, Array]
    initial_performance: Array

    @classmethod
    def stack(cls, episodes: Sequence["Episode"]) -> "Episode":
        """Episodes of one task as one with a leading dimension, padded with zeros (NumPy)."""
        return cls(*(stack(values) for values in zip(*map(_fields, episodes), strict=True)))


def _fields(episode: Episode) -> tuple:
    return tuple(getattr(episode, field.name) for field in dataclasses.fields(episode))


def stack(values: Sequence) -> Array:
    """Arrays of any sizes, or dicts of such, with a leading dimension, padded with zeros."""
    if isinstance(values[0], dict):
        return {key: stack([value[key] for value in values]) for key in values[0]}
    arrays = [np.asarray(value) for value in values]
    largest = np.max([array.shape for array in arrays], axis=0).astype(int)
    whole = np.zeros((len(arrays), *largest), arrays[0].dtype)
    for i, array in enumerate(arrays):
        whole[i, ...][tuple(slice(size) for size in array.shape)] = array
    return whole
