"""Variations by index: splits, random generators, and the interface of start states.

A variation is an index 0..999 of a `Start`. Its random numbers come from a generator seeded with a
hash of the start's name and that index, so it is the same on every machine and in any order.
"""

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.exceptions import InvalidArgumentError, check_count

NUM_VARIATIONS = 1000
SPLITS = {
    "train": range(0, 800),
    "evaluate": range(800, NUM_VARIATIONS),
    "all": range(NUM_VARIATIONS),
}


class Start(Protocol):
    """Source of the start states of a family of variations; picklable."""

    @property
    def name(self) -> str:
        """Name of the set of states, part of file names."""

    @property
    def parameters(self) -> dict[str, object]:
        """JSON-able parameters that determine the generated states."""
        ...

    @property
    def max_points(self) -> int:
        """Largest number of points in any variation."""
        ...

    def sizes(self, index: int) -> Sequence[Any]:
        """Returns the sizes of a task's first objects in a variation, in order."""
        ...

    def generate(self, index: int) -> np.ndarray:
        """Returns settled vertices (n, 3) [m] of a variation; a pure function of `index`."""
        ...

    def generate_all(self, indices: Sequence[int], device: Device) -> list[np.ndarray]:
        """Returns settled vertices (n, 3) [m] of several variations, simulated on a device."""
        ...


def check_variation(index: object) -> int:
    """Returns the index as int.

    Raises:
        InvalidArgumentError: if it is not a whole number in 0..999.
    """
    return check_count("variation", index, 0, NUM_VARIATIONS - 1)


def split_indices(split: str | Sequence[int]) -> Sequence[int]:
    """Returns the variation indices of a split.

    Args:
        split: "train" (0..799), "evaluate" (800..999), "all" or a sequence of different indices.

    Raises:
        InvalidArgumentError: for another name, no index, one above 999 or one twice.
    """
    if isinstance(split, np.ndarray) and split.ndim:
        split = split.tolist()
    if isinstance(split, Sequence) and not isinstance(split, str):
        indices = [check_variation(index) for index in split]
        if not indices or len({*indices}) < len(indices):
            valid = "a split name, or at least one variation, each of them once"
            raise InvalidArgumentError("split", split, valid)
        return indices
    if not isinstance(split, str) or split not in SPLITS:
        raise InvalidArgumentError("split", split, [*SPLITS, "a sequence of variation indices"])
    return SPLITS[split]


def evaluation_variations(number: int, split: str = "evaluate") -> tuple[int, ...]:
    """Returns the first `number` variations of a split: "evaluate", or "train" or "all"."""
    indices = split_indices(split)
    check_count("episodes", number, 1, len(indices))
    return tuple(indices[:number])


def generator(name: str, index: int) -> np.random.Generator:
    """Returns the random generator of variation `index` of the family `name`."""
    digest = hashlib.sha256(f"softgym_mj/{name}/{check_variation(index)}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))


def check_settings(settings: Mapping[str, Any]) -> None:
    """Raises `InvalidArgumentError` for settings that variations determine."""
    for name in ("split", "random_state"):
        if name in settings:
            valid = f"arguments of the task; not {name!r}, which `variations` determines"
            raise InvalidArgumentError("settings", dict(settings), valid)
