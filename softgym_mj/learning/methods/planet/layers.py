"""Layers of world models of several seeds, with PyTorch's default initialization.

They are those of SoftGym's authors (softagent's `planet/models.py`).
"""

import itertools
import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.networks import Linear, drawn

_SMALLEST = 16  # Minimum image side [pixels].


class Dense(Linear):
    """Linear layer of each seed, with PyTorch's default initialization."""

    def __init__(
        self, sources: Sequence[torch.Generator], inputs: int, outputs: int, fan_in: int = 0
    ):
        nn.Module.__init__(self)
        self.weight = _uniform(sources, fan_in or inputs, inputs, outputs)
        self.bias = _uniform(sources, fan_in or inputs, 1, outputs)


class GRU(nn.Module):
    """Gated recurrent unit of each seed, with PyTorch's equations."""

    def __init__(self, sources: Sequence[torch.Generator], inputs: int, size: int):
        super().__init__()
        self.seen = Dense(sources, inputs, 3 * size, size)
        self.state_gates = Dense(sources, size, 3 * size, size)

    def forward(self, x: Tensor, state: Tensor) -> Tensor:
        """Returns the state (seeds, n, size) after inputs (seeds, n, inputs)."""
        reset, update, new = self.seen(x).chunk(3, dim=-1)
        own_reset, own_update, own_new = self.state_gates(state).chunk(3, dim=-1)
        new = torch.tanh(new + torch.sigmoid(reset + own_reset) * own_new)
        return torch.lerp(new, state, torch.sigmoid(update + own_update))


class Convolution(nn.Module):
    """Convolution of stride 2 of each seed; one grouped convolution would be slower."""

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        inputs: int,
        outputs: int,
        kernel: int,
        *,
        transposed: bool = False,
    ):
        super().__init__()
        sizes = (inputs, outputs) if transposed else (outputs, inputs)
        fan_in = sizes[1] * kernel**2  # As in PyTorch, also for transposed convolutions.
        self.weight = _uniform(sources, fan_in, *sizes, kernel, kernel)
        self.bias = _uniform(sources, fan_in, outputs)
        self._turned = functional.conv_transpose2d if transposed else functional.conv2d

    def forward(self, x: Tensor, seed: int) -> Tensor:
        """Convolves images (n, inputs, h, w) with the weights of a seed, in their data type."""
        return self._turned(x, self.weight[seed].to(x.dtype), self.bias[seed].to(x.dtype), stride=2)


class Encoder(nn.Module):
    """Convolutions of kernel 4 down to 2 x 2; each doubles the channels."""

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        image_size: int,
        channels: int,
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights; `kind` is the precision of convolutions, weights are float32."""
        super().__init__()
        number = _depth(image_size)
        sizes = [3, *(channels >> k for k in reversed(range(number)))]
        layers = (Convolution(sources, *pair, 4) for pair in itertools.pairwise(sizes))
        self.layers = nn.ModuleList(layers)
        self._kind = kind

    def forward(self, image: Tensor) -> Tensor:
        """Returns (seeds, n, 4 * channels) of images (seeds, n, size, size, 3)."""
        return torch.stack([self._single(own, k) for k, own in enumerate(image)])

    def _single(self, image: Tensor, seed: int) -> Tensor:
        x = image.permute(0, 3, 1, 2).to(self._kind)  # Channels stay last in memory.
        for layer in self.layers:
            x = functional.relu(layer(x, seed))
        return x.flatten(1).float()


class Decoder(nn.Module):
    """Transposed convolutions from 1 x 1: of kernel 5, and 6 in the last two layers."""

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        image_size: int,
        features: int,
        embedding: int,
        channels: int,
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights; `kind` is the data type of convolutions."""
        super().__init__()
        number = _depth(image_size)
        sizes = [embedding, *(channels >> k for k in range(1, number)), 3]
        self.first = Dense(sources, features, embedding)
        kernels = [*[5] * (number - 2), 6, 6]
        self.layers = nn.ModuleList(
            Convolution(sources, sizes[k], sizes[k + 1], kernels[k], transposed=True)
            for k in range(number)
        )
        self._kind = kind

    def forward(self, features: Tensor) -> Tensor:
        """Returns images (seeds, n, size, size, 3) of features (seeds, n, features)."""
        first = self.first(features).to(self._kind)
        return torch.stack([self._single(own, k) for k, own in enumerate(first)])

    def _single(self, x: Tensor, seed: int) -> Tensor:
        x = x[..., None, None].contiguous(memory_format=torch.channels_last)
        for layer in self.layers[:-1]:
            x = functional.relu(layer(x, seed))
        return self.layers[-1](x, seed).permute(0, 2, 3, 1).float()


def _depth(image_size: int) -> int:
    """Returns the number of layers that halve an image down to 2 x 2."""
    if image_size < _SMALLEST or image_size & (image_size - 1):
        raise InvalidArgumentError("image_size", image_size, "16, 32, 64, 128, ... pixels")
    return image_size.bit_length() - 3


def _uniform(sources: Sequence[torch.Generator], fan_in: int, *shape: int) -> nn.Parameter:
    """Returns initial weights (seeds, *shape), drawn as in PyTorch."""
    return nn.Parameter((2.0 * drawn(sources, *shape, normal=False) - 1.0) / math.sqrt(fan_in))


def dense_layers(sources: Sequence[torch.Generator], *sizes: int) -> nn.Sequential:
    """Returns linear layers with ReLU between them."""
    result = [(Dense(sources, *pair), nn.ReLU()) for pair in itertools.pairwise(sizes)]
    return nn.Sequential(*itertools.chain(*result))[:-1]
