"""`Ring`: a buffer of the newest vector steps of several seeds."""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from softgym_mj.learning.networks import generators

# Newest env steps whose images are in a state; all images are tens of gigabytes.
NEWEST_IMAGES = 20_000
_log = logging.getLogger(__name__)


class Ring:
    """Ring buffer of vector steps; each seed has environments of its own.

    Samples read `_extent` and do not synchronize with the device, so they can be part of a CUDA
    graph.

    Attributes:
        arrays: Arrays (capacity, seeds, num_envs, ...) by name.
        size: Number of vector steps.
        sources: Random generators of samples, one per seed.
    """

    def __init__(
        self,
        capacity: int,
        seeds: Sequence[int],
        num_envs: int,
        entries: Mapping[str, tuple[tuple[int, ...], torch.dtype]],
        device: torch.device | str,
    ):
        """Allocates the buffer.

        Args:
            capacity: Maximum number of vector steps.
            seeds: Seeds of the samples.
            num_envs: Number of environments of each seed.
            entries: Shape of a single entry and data type by name.
            device: PyTorch device.
        """
        self._capacity, self.size, self._next, self._num_envs = capacity, 0, 0, num_envs
        self._is_cut = False  # Whether a restored state lacks steps before the oldest.
        self.sources = generators(seeds, device)
        lead = capacity, len(seeds), num_envs
        self.arrays = {
            name: torch.zeros(*lead, *shape, dtype=kind, device=device)
            for name, (shape, kind) in entries.items()
        }
        # Number of vector steps, index of the oldest, and whether it had one before it.
        self._extent = torch.zeros(3, dtype=torch.int64, device=device)

    def _append(self, values: Mapping[str, Tensor]) -> None:
        """Adds a vector step: arrays (seeds, num_envs, ...) by name."""
        for name, array in self.arrays.items():
            array[self._next] = values[name]
        self._next = (self._next + 1) % self._capacity
        self.size = min(self.size + 1, self._capacity)
        self._note()

    def _note(self) -> None:
        """Copies the extent to the device."""
        is_full = self.size == self._capacity
        oldest = self._next if is_full else 0
        for k, number in enumerate((self.size, oldest, is_full or self._is_cut)):
            self._extent[k].fill_(number)

    def _num_stored(self) -> int:
        """Returns the number of newest vector steps that a state has; with all, it is exact."""
        return self.size

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues."""
        number = self._num_stored()
        newest = (torch.arange(number) + self._next - number) % self._capacity
        return {
            "arrays": {name: each[newest.to(each.device)] for name, each in self.arrays.items()},
            "whole": self.size,
            "is_cut": self._is_cut or number < self.size,
            "random": [source.get_state() for source in self.sources],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.size, self._is_cut = len(next(iter(state["arrays"].values()))), state["is_cut"]
        self._next = self.size % self._capacity
        if self.size < state["whole"]:
            _log.info("Continues with the newest %d of %d steps", self.size, state["whole"])
        for name, array in state["arrays"].items():
            self.arrays[name][: self.size] = array
        for source, saved in zip(self.sources, state["random"], strict=True):
            source.set_state(saved)
        self._note()
