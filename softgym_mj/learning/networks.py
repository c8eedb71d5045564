"""Networks of several seeds that are trained together, with a leading dimension of seeds.

The numbers of a seed do not depend on other seeds: each has a random generator of its own.
"""

import copy
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

_EPSILON = 1e-5  # Epsilon of LayerNorm.


def generators(seeds: Sequence[int], device: torch.device | str) -> list[torch.Generator]:
    """Returns a random generator for each seed."""
    return [torch.Generator(device).manual_seed(seed) for seed in seeds]


def drawn(sources: Sequence[torch.Generator], *shape: int, normal: bool = True) -> Tensor:
    """Returns random numbers (seeds, *shape), standard normal or uniform in 0..1."""
    draw: Callable[..., Tensor] = torch.randn if normal else torch.rand
    return torch.stack([draw(shape, generator=s, device=s.device) for s in sources])


def whole_numbers(shares: Tensor, number: Tensor | int) -> Tensor:
    """Converts shares in 0..1 to integers in 0..number - 1; arrays (...) of both broadcast."""
    return (shares * number).long().clamp(max=number - 1)


def where(mask: Tensor, these: Tensor, others: Tensor) -> Tensor:
    """Returns `these` where the mask (seeds, n) is true, else `others`; both (seeds, n, ...)."""
    return torch.where(mask.reshape(*mask.shape, *[1] * (others.ndim - 2)), these, others)


def lines(shares: Tensor, whole: int, part: int, pad: int) -> Tensor:
    """Returns indices (..., part) of consecutive rows or columns of images with `whole` of them.

    Args:
        shares: Numbers (...) in 0..1 that select the first index.
        whole, part: Numbers of rows or columns.
        pad: Padding by which images are extended beyond their edges.
    """
    first = whole_numbers(shares, whole + 2 * pad - part + 1) - pad
    return (first[..., None] + torch.arange(part, device=shares.device)).clamp(0, whole - 1)


def any_actions(sources: Sequence[torch.Generator], number: int, size: int) -> Tensor:
    """Returns uniformly random actions (seeds, number, size)."""
    return 2.0 * drawn(sources, number, size, normal=False) - 1.0


class Linear(nn.Module):
    """Linear layer of each seed, with orthogonal initial weights and zero bias."""

    def __init__(
        self, sources: Sequence[torch.Generator], inputs: int, outputs: int, gain: float = 1.0
    ):
        super().__init__()
        weights = []
        for source in sources:
            flat = torch.randn(
                max(inputs, outputs), min(inputs, outputs), generator=source, device=source.device
            )
            q, r = torch.linalg.qr(flat)
            q = q * torch.sign(torch.diagonal(r))
            weights.append(gain * (q if inputs >= outputs else q.T))
        self.weight = nn.Parameter(torch.stack(weights))
        zeros = torch.zeros(len(sources), 1, outputs, device=sources[0].device)
        self.bias = nn.Parameter(zeros)

    def forward(self, x: Tensor) -> Tensor:
        """Maps inputs (seeds, n, inputs) to outputs (seeds, n, outputs)."""
        # Unlike `baddbmm`, a separate addition can be fused with the next operation.
        return torch.bmm(x, self.weight) + self.bias


class LayerNorm(nn.Module):
    """LayerNorm of the last dimension, with scale and shift of each seed."""

    def __init__(self, seeds: int, size: int, device: torch.device | str):
        super().__init__()
        self.weight = nn.Parameter(torch.ones(seeds, 1, size, device=device))
        self.bias = nn.Parameter(torch.zeros(seeds, 1, size, device=device))

    def forward(self, x: Tensor) -> Tensor:
        """Normalizes an array (seeds, n, size)."""
        return nn.functional.layer_norm(x, x.shape[-1:], eps=_EPSILON) * self.weight + self.bias


class MLP(nn.Sequential):
    """Multilayer perceptron of each seed, with ReLU."""

    def __init__(
        self, sources: Sequence[torch.Generator], sizes: Sequence[int], *, norm: bool = False
    ):
        """Draws the weights.

        Args:
            sources: Random generators, one per seed.
            sizes: Sizes of the input, of hidden layers and of the output.
            norm: Whether hidden layers have LayerNorm without weights before their ReLU.
        """
        layers: list[nn.Module] = []
        for k, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
            is_last = k == len(sizes) - 2
            layers.append(Linear(sources, inputs, outputs, 1.0 if is_last else math.sqrt(2.0)))
            if not is_last:
                if norm:
                    layers.append(nn.LayerNorm(outputs, _EPSILON, elementwise_affine=False))
                layers.append(nn.ReLU(inplace=True))
        super().__init__(*layers)


class Actor(nn.Module):
    """Tanh-squashed Gaussian policy.

    Attributes:
        seen: Module that maps observations to the input of the network.
        body: The network.
        low, high: Bounds of the log standard deviation, which tanh squashes.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        observation: int,
        action: int,
        hidden: Sequence[int],
        log_std: tuple[float, float],
    ):
        super().__init__()
        self.seen: nn.Module = nn.Identity()
        self.body = MLP(sources, [observation, *hidden, 2 * action])
        self.low, self.high = log_std

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Returns mean and log standard deviation (seeds, n, action) before tanh."""
        mean, squashed = self.body(self.seen(observation)).chunk(2, dim=-1)
        share = 0.5 * (torch.tanh(squashed) + 1.0)
        return mean, self.low + share * (self.high - self.low)

    def sample(self, observation: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Returns actions (seeds, n, action) and their log densities (seeds, n).

        Args:
            observation: Observations (seeds, n, observation).
            noise: Standard normal numbers (seeds, n, action).
        """
        mean, log_std = self(observation)
        before = mean + noise * log_std.exp()
        density = -0.5 * noise**2 - log_std - 0.5 * math.log(2.0 * math.pi)
        # log(1 - tanh(x)^2), numerically stable.
        slope = 2.0 * (math.log(2.0) - before - nn.functional.softplus(-2.0 * before))
        return torch.tanh(before), (density - slope).sum(-1)

    def mean(self, observation: Tensor) -> Tensor:
        """Returns the action (seeds, n, action) without noise."""
        return torch.tanh(self(observation)[0])


class Critics(nn.Module):
    """Ensemble of action-value networks of each seed.

    Attributes:
        number: Number of critics of each seed.
        seen: Module that maps observations to the input of the networks.
        body: The networks: all critics of a seed, then those of the next.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        observation: int,
        action: int,
        hidden: Sequence[int],
        *,
        norm: bool,
        number: int = 2,
        outputs: int = 1,
    ):
        super().__init__()
        self.number, self.seen = number, nn.Identity()
        each = [source for source in sources for _ in range(number)]
        self.body = MLP(each, [observation + action, *hidden, outputs], norm=norm)

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Returns action values (number, seeds, n), or (number, seeds, n, outputs) of several."""
        both = torch.cat([self.seen(observation), action], dim=-1).repeat_interleave(self.number, 0)
        values = self.body(both).unflatten(0, (-1, self.number)).transpose(0, 1)
        return values[..., 0] if values.shape[-1] == 1 else values


class DeterministicPolicy(nn.Module):
    """Deterministic policy of one seed, on the CPU: maps observations (n, k) to mean actions."""

    def __init__(self, actor: nn.Module, seed: int):
        super().__init__()
        self.actor = copy.deepcopy(actor).cpu()
        for array in self.actor.parameters():
            array.data = array.data[seed : seed + 1].clone()
        self.requires_grad_(False)

    def forward(self, observation: Tensor) -> Tensor:
        return self.actor.mean(observation[None])[0]


class StoredInHalf(nn.Module):
    """A network whose file is half as large: weights are stored as float16, used as float32."""

    def __init__(self, network: nn.Module):
        """Rounds the weights.

        Args:
            network: without buffers.
        """
        super().__init__()
        self.network = network.requires_grad_(False)
        self._names = [name for name, _ in network.named_parameters()]
        self._halves = nn.ParameterList(
            nn.Parameter(weight.half(), requires_grad=False) for weight in network.parameters()
        )
        for weight in network.parameters():
            weight.data = weight.data.new_empty(0)  # `forward` replaces it.

    def forward(self, observation: Any) -> Tensor:
        """Returns what the network returns."""
        weights = {name: half.float() for name, half in zip(self._names, self._halves, strict=True)}
        return torch.func.functional_call(self.network, weights, (observation,))
