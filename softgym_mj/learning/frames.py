"""`Frames`: a buffer of the newest env steps of several seeds that stores each image once.

Images are sampled as stacks of successive frames of an episode.
"""

import math
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from softgym_mj.learning.networks import drawn, lines, where, whole_numbers
from softgym_mj.learning.ring import NEWEST_IMAGES, Ring

_AGE = "_age"  # Array of env steps since the start of the episode.


class Frames(Ring):
    """Ring buffer of observations, which are sampled with earlier frames of their episode."""

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
        self._frames, self._shift = frames, shift
        self._images = {name for name, shape in shapes.items() if len(shape) > 1}
        entries = {name: (shape, _kind(name, shape)) for name, shape in shapes.items()}
        entries[_AGE] = (), torch.int64
        super().__init__(max(capacity, frames), seeds, num_envs, entries, device)

    def add(self, values: Mapping[str, Tensor], first: Tensor) -> None:
        """Adds a vector step.

        Args:
            values: Arrays (seeds, num_envs, ...) by name.
            first: Whether each is the first of an episode (seeds, num_envs).
        """
        age = (self.arrays[_AGE][self._next - 1] + 1).masked_fill(first, 0)
        self._append({**values, _AGE: age})

    def sample(self, k: int, number: int) -> dict[str, Tensor]:
        """Samples entries of the k-th seed uniformly.

        Returns:
            Arrays (number, ...) by name; images are (number, frames, ...), the oldest first.
        """
        size, oldest, is_later = self._extent
        lacking = (self._frames - 1) * is_later  # Steps of which earlier frames are missing.
        shares = drawn(self.sources[k : k + 1], 4, number, normal=False)[0]
        at = (oldest + lacking + whole_numbers(shares[0], size - lacking)) % self._capacity
        env_index = whole_numbers(shares[1], self._num_envs)
        back = torch.arange(self._frames - 1, -1, -1, device=at.device)
        age = self.arrays[_AGE][at, k, env_index, None]
        past = (at[:, None] - torch.minimum(back, age)) % self._capacity
        return {
            name: self._moved(array[:, k], past, env_index[:, None], shares[2:])
            if name in self._images
            else array[at, k, env_index]
            for name, array in self.arrays.items()
            if name != _AGE
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

    def _num_stored(self) -> int:
        newest = NEWEST_IMAGES // math.prod(self.arrays[_AGE].shape[1:])
        return min(self.size, max(newest, self._frames))


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
