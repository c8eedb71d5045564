"""Soft actor-critic from images, of several seeds at once: what CURL and DrQ have in common.

Actor and critics share convolutions, with a linear layer, LayerNorm and losses of their own behind
them; only critics teach the convolutions (softagent's `encoder.py`). Each seed's convolutions are
dense ones of their own: as groups of one convolution they take longer. Sources of numbers: [S] is
softagent's `curl/encoder.py`, `curl/curl_sac.py`.
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
LEAST = 15  # Pixels of which these leave one.


@typed
@dataclasses.dataclass(frozen=True)
class PixelSettings(SACSettings):
    """How it learns; the defaults are the paper's.

    Attributes:
        channels: of each convolution.
        features: of an image, for actor and critics.
        tanh: whether these go through tanh.
        bfloat16: whether convolutions calculate in bfloat16, with weights of 32 bits: twice as fast
            on a GPU.

    Raises:
        InvalidArgumentError: for numbers out of range.
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
            raise InvalidArgumentError("symmetric", True, "False: images are shown as they are")


def picture_size(problem: Problem) -> tuple[int, int]:
    """Height and width of a problem's images.

    Raises:
        InvalidArgumentError: if it has none, or too small ones.
    """
    if len(problem.observation) != 3 or min(problem.observation[:2]) < LEAST:
        valid = f"images (height, width, 3) of {LEAST} or more pixels: observation 'rgb'"
        raise InvalidArgumentError("observation", problem.observation, valid)
    return problem.observation[0], problem.observation[1]


# ------------------------------------------------------------------ images


def cropped(pictures: Tensor, size: tuple[int, int], shares: Tensor, pad: int = 0) -> Tensor:
    """Returns a part (seeds, n, *size, 3) of each picture.

    Args:
        pictures: (seeds, n, height, width, 3).
        size: height and width of parts.
        shares: numbers (seeds, 2, n) in 0..1 that choose the row and column where one begins, of
            all that there are.
        pad: pixels by which pictures go on beyond their edges, which are repeated.
    """
    rows, columns = (
        lines(shares[:, k], pictures.shape[2 + k], size[k], pad) for k in range(2)
    )  # (seeds, n, size[k]) each.
    seeds, n = (torch.arange(length, device=pictures.device) for length in pictures.shape[:2])
    which = seeds[:, None, None, None], n[:, None, None]
    return pictures[*which, rows[..., :, None], columns[..., None, :]]


def centre(pictures: Tensor, size: tuple[int, int]) -> Tensor:
    """Returns the part (..., *size, 3) in the middle of pictures (..., height, width, 3)."""
    (height, width), (rows, columns) = pictures.shape[-3:-1], size
    top, left = (height - rows) // 2, (width - columns) // 2
    return pictures[..., top : top + rows, left : left + columns, :]


# ------------------------------------------------------------------ networks


class Convolutions(nn.Module):
    """Convolutions of all seeds with ReLU behind each.

    Attributes:
        outputs: numbers for an image.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        channels: int,
        size: tuple[int, int],
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights: orthogonal in the middle of kernels, else 0 [S].

        Args:
            sources: of random numbers, one a seed.
            channels: of each.
            size: height and width of what is seen: the middle of larger pictures.
            kind: in which they calculate; weights and outputs are float32.
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
        """Of uint8 (seeds, n, height, width, 3): (seeds, n, outputs)."""
        seen = center(pictures, self._size)
        return torch.stack([self._single(own, k) for k, own in enumerate(seen)])

    def _single(self, seen: Tensor, seed: int) -> Tensor:
        """Of the seed at a place: (n, outputs)."""
        kind = self._kind
        x = seen.permute(0, 3, 1, 2).to(kind) / 255.0  # Channels stay last in memory.
        for weight, bias, stride in zip(self.weights, self.biases, _STRIDES, strict=True):
            own = weight[seed].to(kind), bias[seed].to(kind)
            x = torch.relu(nn.functional.conv2d(x, *own, stride))
        return x.permute(0, 2, 3, 1).flatten(1).float()


class StopGradient(nn.Module):
    """Lets no gradient through."""

    def forward(self, x: Tensor) -> Tensor:
        """Returns the same numbers."""
        return x.detach()


class SeenCritics(nn.Module):
    """Critics of what an encoder makes of images.

    Attributes:
        encoder: from images (seeds, n, height, width, 3) to features (seeds, n, k).
        critics: of these.
    """

    def __init__(self, encoder: nn.Module, critics: nn.Module):
        super().__init__()
        self.encoder, self.critics = encoder, critics

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Of (seeds, n, ...): (2, seeds, n)."""
        return self.critics(self.encoder(observation), action)


class PixelSAC(SAC):
    """Actors and critics that see images: `SAC` on features that critics learn."""

    settings: PixelSettings

    def __init__(
        self,
        settings: PixelSettings,
        seeds: Sequence[int],
        size: tuple[int, int],
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks.

        Args:
            settings: how it learns.
            seeds: of the random numbers, each of a training of its own.
            size: height and width of what is seen: the middle of larger pictures.
            action: size.
            device: where.
        """
        self._size = size
        super().__init__(settings, seeds, settings.features, action, device)

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        actor, critics = super()._networks(observation, action)
        kind = torch.bfloat16 if self.settings.bfloat16 else torch.float32
        convolutions = Convolutions(self.sources, self.settings.channels, self._size, kind)
        own, shared = (self._head(convolutions.outputs, observation) for _ in range(2))
        actor.body = nn.Sequential(convolutions, StopGradient(), *own, *actor.body)
        return actor, SeenCritics(nn.Sequential(convolutions, *shared), critics)

    def _head(self, inputs: int, features: int) -> list[nn.Module]:
        """Layers behind the convolutions."""
        norm = LayerNorm(len(self.sources), features, self.sources[0].device)
        layers = [Linear(self.sources, inputs, features), norm]
        return [*layers, nn.Tanh()] if self.settings.tanh else layers
