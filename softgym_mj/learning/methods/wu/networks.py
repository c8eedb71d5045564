"""Networks of an image and a pick point (Wu et al.), for several seeds.

Numbers marked [S] are from softagent's `rlpyt_cloth`: `models/conv2d.py`, `models/qpg/conv2d.py`,
`agents/qpg/sac_agent_v2.py`.
"""

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from softgym_mj.learning.networks import MLP, Actor, LayerNorm, Linear

PICK = 2  # Size of a pick point.
_TILES = 50  # Repetitions of the pick point in the input, next to the features of the image [S].
_STRIDE = 2  # [S]


class Convolutions(nn.Module):
    """Convolutions of each seed, with LayerNorm and LeakyReLU.

    Attributes:
        outputs: Number of outputs for an image.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        channels: Sequence[int],
        size: tuple[int, int],
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights.

        Args:
            sources: Random generators, one per seed.
            channels: Channels of each convolution.
            size: Height and width of images.
            kind: Data type of the computation; weights and outputs are float32.
        """
        super().__init__()
        self._kind = kind
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        self.norms, inputs, self.outputs = nn.ModuleList(), 3, 0
        for outputs in channels:
            own = Linear(sources, 9 * inputs, outputs, math.sqrt(2.0))
            kernels = own.weight.detach().mT.unflatten(-1, (inputs, 3, 3))
            self.weights.append(nn.Parameter(kernels.contiguous()))
            self.biases.append(nn.Parameter(own.bias.detach()[:, 0].clone()))
            size = -(-size[0] // _STRIDE), -(-size[1] // _STRIDE)
            self.outputs, inputs = outputs * size[0] * size[1], outputs
            self.norms.append(LayerNorm(len(sources), self.outputs, sources[0].device))

    def forward(self, images: Tensor) -> Tensor:
        """Maps images 0..255 (seeds, n, height, width, 3) to outputs (seeds, n, outputs)."""
        x = (images.float() * (2.0 / 255.0) - 1.0).permute(0, 1, 4, 2, 3)
        for weights, biases, norm in zip(self.weights, self.biases, self.norms, strict=True):
            # Separate convolutions of seeds are faster than one grouped convolution.
            each = [
                nn.functional.conv2d(*(a.to(self._kind) for a in own), _STRIDE, padding=1)
                for own in zip(x, weights, biases, strict=True)
            ]
            x = torch.stack(each).float()
            x = nn.functional.leaky_relu(norm(x.flatten(2))).view_as(x)
        return x.flatten(2)


class Looking(nn.Module):
    """Network of an image, a pick point and, for critics, a place point.

    The input is an array (seeds, n, height * width * 3 + 2) of `seen`.

    Attributes:
        convolutions: The convolutions.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        channels: Sequence[int],
        size: tuple[int, int],
        hidden: Sequence[int],
        outputs: int,
        *,
        place: int = 0,
        norm: bool = False,
        kind: torch.dtype = torch.float32,
    ):
        super().__init__()
        self._size = size
        self.convolutions = Convolutions(sources, channels, size, kind)
        inputs = self.convolutions.outputs + PICK * _TILES + place
        self.head = MLP(sources, [inputs, *hidden, outputs], norm=norm)
        for k, layer in enumerate(self.head):
            if isinstance(layer, nn.ReLU):
                self.head[k] = nn.LeakyReLU()

    def forward(self, both: Tensor, *place: Tensor) -> Tensor:
        """Maps `seen` arrays and place points (seeds, n, 3) to outputs (seeds, n, outputs)."""
        images = both[..., :-PICK].unflatten(-1, (*self._size, 3))
        return self.judge(self.convolutions(images), both[..., -PICK:], *place)

    def judge(self, features: Tensor, pick: Tensor, *place: Tensor) -> Tensor:
        """Returns outputs (seeds, n, outputs) of features of the convolutions."""
        return self.head(torch.cat([features, pick.repeat(1, 1, _TILES), *place], -1))


def seen(images: Tensor, pick: Tensor) -> Tensor:
    """Returns images (seeds, n, height, width, 3) and pick points (seeds, n, 2) as one array."""
    return torch.cat([images.flatten(2).float(), pick], -1)


class Placing(Actor):
    """Actor of place points, with clamped log standard deviations."""

    body: Looking

    def __init__(self, body: Looking, log_std: tuple[float, float]):
        nn.Module.__init__(self)
        self.body, (self.low, self.high) = body, log_std

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Returns mean and log standard deviation (seeds, n, 3) before tanh, of `seen` arrays."""
        mean, log_std = self.body(observation).chunk(2, dim=-1)
        return mean, log_std.clamp(self.low, self.high)


class Judging(nn.Module):
    """Two critics of place points."""

    def __init__(self, pair: Sequence[Looking]):
        super().__init__()
        self.pair = nn.ModuleList(pair)

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Returns values (2, seeds, n) of `seen` arrays and place points (seeds, n, 3)."""
        return torch.stack([critic(observation, action)[..., 0] for critic in self.pair])
