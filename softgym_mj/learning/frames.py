"""`Frames`: a buffer of the newest env steps of several seeds that stores each image once.

Images are sampled as stacks of successive frames of an episode.
"""

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor

from softgym_mj.learning.networks import drawn, generators, lines, where, whole_numbers
from softgym_mj.learning.replay import NEWEST_IMAGES

_log = logging.getLogger(__name__)


class Frames:
    """Ring buffer of vector steps: arrays (capacity, seeds, num_envs, ...) by name.

    `sample` does not synchronize with the device, so it can be part of a CUDA graph.

    Attributes:
        sources: Random generators of samples, one per seed.
    """

    def __init__(
        self,
        capacity: int,
        seeds: Sequence[int],
        num_envs: int,
        shapes: Mapping[str, tuple[int, ...]],
        *,
        frames: int,
        shift: int = 0,
        device: str = "cpu",
    ):
        """Allocates the buffer.

        Args:
            capacity: Number of vector steps.
            seeds: Seeds of the samples.
            num_envs: Number of environments of each seed.
            shapes: Shapes of single entries by name; images have two dimensions or more: (height,
                width), (height, width, 3) or (cameras, height, width, 3).
            frames: Number of frames in a stack; the first one of an episode is repeated.
            shift: Largest random shift of a stack in each direction [pixels]; edges are repeated.
            device: PyTorch device.
        """
        self._frames, self._shift, self._num_envs = frames, shift, num_envs
        self._capacity, self._size, self._next = max(capacity, frames), 0, 0
        self._is_cut = False  # Whether a restored state lacks steps before the oldest.
        lead = self._capacity, len(seeds), num_envs
        self._arrays = {
            name: torch.zeros(*lead, *shape, dtype=_kind(name, shape), device=device)
            for name, shape in shapes.items()
        }
        self._images = {name for name, shape in shapes.items() if len(shape) > 1}
        # Env steps since the start of the episode.
        self._age = torch.zeros(lead, dtype=torch.int64, device=device)
        # Number of stored vector steps, index of the oldest, number that lack earlier frames.
        self._extent = torch.zeros(3, dtype=torch.int64, device=device)
        self.sources = generators(seeds, device)

    def add(self, values: Mapping[str, Tensor], first: Tensor) -> None:
        """Adds a vector step.

        Args:
            values: Arrays (seeds, num_envs, ...) by name.
            first: Whether each is the first of an episode (seeds, num_envs).
        """
        for name, array in self._arrays.items():
            array[self._next] = values[name]
        self._age[self._next] = (self._age[self._next - 1] + 1).masked_fill(first, 0)
        self._next = (self._next + 1) % self._capacity
        self._size = min(self._size + 1, self._capacity)
        self._note()

    def _note(self) -> None:
        is_full = self._size == self._capacity
        oldest = self._next if is_full else 0
        lacking = self._frames - 1 if is_full or self._is_cut else 0
        for k, number in enumerate((self._size, oldest, lacking)):
            self._extent[k].fill_(number)

    def sample(self, k: int, number: int) -> dict[str, Tensor]:
        """Samples entries of the k-th seed uniformly.

        Returns:
            Arrays (number, ...) by name; images are (number, frames, ...), the oldest first.
        """
        size, oldest, lacking = self._extent
        shares = drawn(self.sources[k : k + 1], 4, number, normal=False)[0]
        at = (oldest + lacking + whole_numbers(shares[0], size - lacking)) % self._capacity
        env_index = whole_numbers(shares[1], self._num_envs)
        back = torch.arange(self._frames - 1, -1, -1, device=at.device)
        age = self._age[at, k, env_index, None]
        past = (at[:, None] - torch.minimum(back, age)) % self._capacity
        return {
            name: self._moved(array[:, k], past, env_index[:, None], shares[2:])
            if name in self._images
            else array[at, k, env_index]
            for name, array in self._arrays.items()
        }

    def _moved(self, array: Tensor, at: Tensor, env_index: Tensor, shares: Tensor) -> Tensor:
        """Returns images at indices (n, frames), each stack shifted by shares (2, n) in 0..1."""
        is_several = array.ndim == 6
        sides = array.shape[3:5] if is_several else array.shape[2:4]
        rows, columns = (
            lines(own, side, side, self._shift) for own, side in zip(shares, sides, strict=True)
        )
        rows, columns = rows[:, None, :, None], columns[:, None, None, :]
        if not is_several:
            return array[at[..., None, None], env_index[..., None, None], rows, columns]
        cameras = torch.arange(array.shape[2], device=at.device)[:, None, None]
        lead = at[..., None, None, None], env_index[..., None, None, None]
        return array[*lead, cameras, rows[:, None], columns[:, None]]

    def get_state(self) -> dict[str, Any]:
        """Returns the state for `set_state`.

        It has the images of the newest `NEWEST_IMAGES` env steps of all seeds together, as all may
        be tens of gigabytes; with fewer images the continuation is exact.
        """
        number = min(self._size, max(NEWEST_IMAGES // math.prod(self._age.shape[1:]), self._frames))
        newest = (torch.arange(number) + self._next - number) % self._capacity
        arrays = {**self._arrays, "_age": self._age}
        return {
            "arrays": {name: array[newest.to(array.device)] for name, array in arrays.items()},
            "whole": self._size,
            "is_cut": self._is_cut or number < self._size,
            "random": [source.get_state() for source in self.sources],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self._size, self._is_cut = len(state["arrays"]["_age"]), state["is_cut"]
        self._next = self._size % self._capacity
        if self._size < state["whole"]:
            _log.info("Continues with the newest %d of %d steps", self._size, state["whole"])
        for name, array in {**self._arrays, "_age": self._age}.items():
            array[: self._size] = state["arrays"][name]
        for source, saved in zip(self.sources, state["random"], strict=True):
            source.set_state(saved)
        self._note()


def pictured(array: Tensor, lead: int = 0) -> Tensor:
    """Returns images as (*lead, height, width, channels).

    Args:
        array: After `lead` dimensions, distances (height, width), colors (height, width, 3), or
            colors of several cameras (cameras, height, width, 3).
        lead: Number of leading dimensions.
    """
    if array.ndim == lead + 2:
        return array[..., None]
    return array.movedim(lead, -2).flatten(-2) if array.ndim == lead + 4 else array


def stacked(now: Tensor, before: Tensor | None, first: Tensor, frames: int) -> Tensor:
    """Returns stacks (seeds, n, frames, ...) of the newest images, the oldest first.

    Args:
        now: Images (seeds, n, ...).
        before: Stacks of the previous env step; None if there was none.
        first: Whether each image is the first of an episode (seeds, n), whose stack repeats it.
        frames: Number of images in a stack.
    """
    newest = now.unsqueeze(2)
    repeated = newest.expand(-1, -1, frames, *now.shape[2:])
    if before is None:
        return repeated
    return where(first, repeated, torch.cat([before[:, :, 1:], newest], 2))


def _kind(name: str, shape: tuple[int, ...]) -> torch.dtype:
    """Returns the data type in which an entry is stored."""
    if len(shape) < 2:
        return torch.float32
    return torch.float16 if "depth" in name else torch.uint8
