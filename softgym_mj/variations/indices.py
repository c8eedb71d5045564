"""Variations by index: splits, random generators, what produces their start states.

A variation is an index 0..999 of a `Start`. Everything random in it comes from a generator
seeded with a hash of the start's name and that index, so it is the same on every machine
and whatever was generated before.
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
    """Produces the start states of a family of variations; picklable."""

    @property
    def name(self) -> str:
        """Of the set of states; part of file names."""

    @property
    def parameters(self) -> dict[str, object]:
        """Everything, JSON-able, that changes the generated states."""
        ...

    @property
    def max_points(self) -> int:
        """Most points of any variation."""
        ...

    def sizes(self, index: int) -> Sequence[Any]:
        """What the objects of a task are resized to in a variation: of the first ones, in order."""
        ...

    def generate(self, index: int) -> np.ndarray:
        """Settled vertex positions (n, 3) [m] of a variation; a pure function of `index`."""
        ...

    def generate_all(self, indices: Sequence[int], device: Device) -> list[np.ndarray]:
        """What `generate` makes of each (n, 3) [m], all together on a device."""
        ...


def check_variation(index: object) -> int:
    """The index as int.

    Raises:
        InvalidArgumentError: if it is not a whole number in 0..999.
    """
    return check_count("variation", index, 0, NUM_VARIATIONS - 1)


def split_indices(split: str | Sequence[int]) -> Sequence[int]:
    """Variation indices of a split.

    Args:
        split: "train" (0..799), "evaluate" (800..999), "all" or at least one index.
    """
    if isinstance(split, Sequence) and not isinstance(split, str):
        if not len(split):
            raise InvalidArgumentError("split", split, "a split name or at least one variation")
        return [check_variation(index) for index in split]
    if not isinstance(split, str) or split not in SPLITS:
        raise InvalidArgumentError("split", split, [*SPLITS, "a sequence of variation indices"])
    return SPLITS[split]


def generator(name: str, index: int) -> np.random.Generator:
    """The random generator of variation `index` of the family `name`."""
    digest = hashlib.sha256(f"softgym_mj/{name}/{check_variation(index)}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))


def check_settings(settings: Mapping[str, Any]) -> None:
    """Raises `InvalidArgumentError` for settings that say what is played, as the variations do."""
    for name in ("split", "random_state"):
        if name in settings:
            valid = f"arguments of the task; not {name!r}, the variations say what is played"
            raise InvalidArgumentError("settings", dict(settings), valid)
