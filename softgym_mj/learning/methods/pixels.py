"""Soft actor-critic from images for several seeds: the common part of CURL and DrQ.

Actor and critics share convolutions, followed by linear layers and LayerNorm of their own. Only the
critic loss trains the convolutions (softagent's `encoder.py`). Each seed has separate convolutions,
which are faster than one grouped convolution. Numbers marked [S] are from softagent's
`curl/encoder.py` and `curl/curl_sac.py`.
"""

import dataclasses
import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import SAC, SACSettings
from softgym_mj.learning.networks import Actor, LayerNorm, Linear, lines
from softgym_mj.validation import typed

_KERNEL, _STRIDES = 3, (2, 1, 1, 1)  # [S]
LEAST = 15  # Minimum image side, of which the convolutions leave one pixel.


@typed
@dataclasses.dataclass(frozen=True)
class PixelSettings(SACSettings):
    """Settings of soft actor-critic from images; the defaults are the paper's.

    Attributes:
        channels: Channels of each convolution.
        features: Number of features of an image, for actor and critics.
        tanh: Whether features pass through tanh.
        bfloat16: Whether convolutions compute in bfloat16 with 32-bit weights: twice as fast on a
            GPU.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    channels: int = 32
    features: int = 50
    tanh: bool = False
    bfloat16: bool = False

    def __post_init__(self):
        super().__post_init__()
        for name in ("channels", "features"):
            check_count(name, getattr(self, name), 1)
        if self.symmetric:
            raise InvalidArgumentError("symmetric", True, "False: images have no symmetries")


def picture_size(problem: Problem, least: int = LEAST) -> tuple[int, int]:
    """Returns height and width of a problem's images.

    Raises:
        InvalidArgumentError: for a problem without images or with sides shorter than `least`.
    """
    if len(problem.observation) != 3 or min(problem.observation[:2]) < least:
        valid = f"images (height, width, 3) of {least} or more pixels: observation 'rgb'"
        raise InvalidArgumentError("observation", problem.observation, valid)
    return problem.observation[0], problem.observation[1]


# ------------------------------------------------------------------ images


def cropped(pictures: Tensor, size: tuple[int, int], shares: Tensor, pad: int = 0) -> Tensor:
    """Returns a crop (seeds, n, *size, 3) of each image.

    Args:
        pictures: Images (seeds, n, height, width, 3).
        size: Height and width of crops.
        shares: Numbers (seeds, 2, n) in 0..1 that select the first row and column.
        pad: Padding [pixels] by repeated edges.
    """
    rows, columns = (
        lines(shares[:, k], pictures.shape[2 + k], size[k], pad) for k in range(2)
    )  # (seeds, n, size[k]) each.
    seeds, n = (torch.arange(length, device=pictures.device) for length in pictures.shape[:2])
    which = seeds[:, None, None, None], n[:, None, None]
    return pictures[*which, rows[..., :, None], columns[..., None, :]]


def center(pictures: Tensor, size: tuple[int, int]) -> Tensor:
    """Returns the center crop (..., *size, 3) of images (..., height, width, 3)."""
    (height, width), (rows, columns) = pictures.shape[-3:-1], size
    top, left = (height - rows) // 2, (width - columns) // 2
    return pictures[..., top : top + rows, left : left + columns, :]


# ------------------------------------------------------------------ networks


class Convolutions(nn.Module):
    """Convolutions of each seed, with ReLU.

    Attributes:
        outputs: Number of outputs for an image.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        channels: int,
        size: tuple[int, int],
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights: orthogonal at the center of kernels, 0 elsewhere [S].

        Args:
            sources: Random generators, one per seed.
            channels: Channels of each convolution.
            size: Height and width of the center crop that is used.
            kind: Data type of the computation; weights and outputs are float32.
        """
        super().__init__()
        self._kind = kind
        self._size, middle = size, _KERNEL // 2
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for k in range(len(_STRIDES)):
            drawn = Linear(sources, channels if k else 3, channels, math.sqrt(2.0))
            taps = drawn.weight.detach().mT
            weight = taps.new_zeros(*taps.shape, _KERNEL, _KERNEL)
            weight[..., middle, middle] = taps
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(drawn.bias.detach()[:, 0].clone()))
        for stride in _STRIDES:
            size = (size[0] - _KERNEL) // stride + 1, (size[1] - _KERNEL) // stride + 1
        self.outputs = channels * size[0] * size[1]

    def forward(self, pictures: Tensor) -> Tensor:
        """Maps images (seeds, n, height, width, 3) uint8 to outputs (seeds, n, outputs)."""
        seen = center(pictures, self._size)
        return torch.stack([self._single(own, k) for k, own in enumerate(seen)])

    def _single(self, seen: Tensor, seed: int) -> Tensor:
        """Returns outputs (n, outputs) of the seed at an index."""
        kind = self._kind
        x = seen.permute(0, 3, 1, 2).to(kind) / 255.0  # The memory layout remains channels-last.
        for weight, bias, stride in zip(self.weights, self.biases, _STRIDES, strict=True):
            own = weight[seed].to(kind), bias[seed].to(kind)
            x = torch.relu(nn.functional.conv2d(x, *own, stride))
        return x.permute(0, 2, 3, 1).flatten(1).float()


class StopGradient(nn.Module):
    """Identity whose gradient is zero."""

    def forward(self, x: Tensor) -> Tensor:
        """Returns the same numbers."""
        return x.detach()


class PixelSAC(SAC):
    """Soft actor-critic on features of images that the critic loss trains."""

    settings: PixelSettings

    def __init__(
        self,
        settings: PixelSettings,
        seeds: Sequence[int],
        size: tuple[int, int],
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks for center crops of a size; other arguments are those of `SAC`."""
        self._size = size
        super().__init__(settings, seeds, settings.features, action, device)

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        actor, critics = super()._networks(observation, action)
        kind = torch.bfloat16 if self.settings.bfloat16 else torch.float32
        convolutions = Convolutions(self.sources, self.settings.channels, self._size, kind)
        own, of_critics = (self._head(convolutions.outputs, observation) for _ in range(2))
        actor.seen = nn.Sequential(convolutions, StopGradient(), *own)
        critics.seen = nn.Sequential(convolutions, *of_critics)
        return actor, critics

    def _head(self, inputs: int, features: int) -> list[nn.Module]:
        """Returns the layers after the convolutions."""
        norm = LayerNorm(len(self.sources), features, self.sources[0].device)
        layers = [Linear(self.sources, inputs, features), norm]
        return [*layers, nn.Tanh()] if self.settings.tanh else layers
