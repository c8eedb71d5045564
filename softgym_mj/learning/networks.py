"""Networks of several seeds that are trained together: arrays have a leading dimension of seeds.

A seed's numbers do not depend on the others: its weights are drawn from a generator of its own, and
nothing mixes them.
"""

import copy
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

_EPSILON = 1e-5  # Of LayerNorm.


def generators(seeds: Sequence[int], device: torch.device | str) -> list[torch.Generator]:
    """A source of random numbers for each seed."""
    return [torch.Generator(device).manual_seed(seed) for seed in seeds]


def drawn(sources: Sequence[torch.Generator], *shape: int, normal: bool = True) -> Tensor:
    """Random numbers (seeds, *shape): normal ones, or in 0..1."""
    draw: Callable[..., Tensor] = torch.randn if normal else torch.rand
    return torch.stack([draw(shape, generator=s, device=s.device) for s in sources])


def whole_numbers(shares: Tensor, number: Tensor | int) -> Tensor:
    """Returns whole numbers from 0 to below `number`, of shares in 0..1 of the same shape (...)."""
    return (shares * number).long().clamp(max=number - 1)


def lines(shares: Tensor, whole: int, part: int, pad: int) -> Tensor:
    """Returns rows or columns (..., part) of pictures that have `whole` of them.

    Args:
        shares: numbers (...) in 0..1 that choose the first one, of all that there are.
        whole, part: numbers of rows or columns.
        pad: by which pictures continue beyond their edges, which are repeated.
    """
    first = whole_numbers(shares, whole + 2 * pad - part + 1) - pad
    return (first[..., None] + torch.arange(part, device=shares.device)).clamp(0, whole - 1)


def any_actions(sources: Sequence[torch.Generator], number: int, size: int) -> Tensor:
    """Random ones (seeds, number, size), all alike likely: before anything is learned."""
    return 2.0 * drawn(sources, number, size, normal=False) - 1.0


class Linear(nn.Module):
    """Layers of all seeds, with orthogonal weights and no bias at first."""

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
        """Of (seeds, n, inputs): (seeds, n, outputs)."""
        # Not `baddbmm`: what is added can be compiled into what follows.
        return torch.bmm(x, self.weight) + self.bias


class LayerNorm(nn.Module):
    """Of the last dimension, with a scale and a shift for each seed."""

    def __init__(self, seeds: int, size: int, device: torch.device | str):
        super().__init__()
        self.weight = nn.Parameter(torch.ones(seeds, 1, size, device=device))
        self.bias = nn.Parameter(torch.zeros(seeds, 1, size, device=device))

    def forward(self, x: Tensor) -> Tensor:
        """Of (seeds, n, size), the same shape."""
        return nn.functional.layer_norm(x, x.shape[-1:], eps=_EPSILON) * self.weight + self.bias


class MLP(nn.Sequential):
    """Layers with ReLU between them."""

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        sizes: Sequence[int],
        *,
        norm: bool = False,
    ):
        """Draws the weights.

        Args:
            sources: of random numbers, one a seed.
            sizes: of the input, of hidden layers and of the output.
            norm: whether hidden layers are normalized before their ReLU, without weights.
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


class ObservationNormalizer(nn.Module):
    """Observations of each seed by their means and deviations; as they are until `fit`.

    Positions are tenths of a meter beside actions of up to 1, which first layers would see alone.
    """

    def __init__(self, seeds: int, size: int, device: torch.device | str):
        super().__init__()
        self.register_buffer("mean", torch.zeros(seeds, 1, size, device=device))
        self.register_buffer("deviation", torch.ones(seeds, 1, size, device=device))

    def fit(self, observation: Tensor, least: float) -> None:
        """Takes means, and deviations of at least this, of observations (seeds, n, size)."""
        self.mean.copy_(observation.mean(1, keepdim=True))
        self.deviation.copy_(observation.std(1, keepdim=True).clamp(min=least))

    def forward(self, observation: Tensor) -> Tensor:
        """Of (seeds, n, size), the same shape."""
        return (observation - self.mean) / self.deviation


class Actor(nn.Module):
    """A Gaussian through tanh, whose mean and log deviation are functions of an observation.

    Attributes:
        seen: makes of observations what the network takes.
        body: the network.
        low, high: of the log deviation, which tanh squashes into them.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        observation: int,
        action: int,
        hidden: Sequence[int],
        log_std: tuple[float, float],
        seen: nn.Module | None = None,
    ):
        super().__init__()
        self.seen = seen or nn.Identity()
        self.body = MLP(sources, [observation, *hidden, 2 * action])
        self.low, self.high = log_std

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and log deviation (seeds, n, action) before tanh."""
        mean, squashed = self.body(self.seen(observation)).chunk(2, dim=-1)
        share = 0.5 * (torch.tanh(squashed) + 1.0)
        return mean, self.low + share * (self.high - self.low)

    def sample(self, observation: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Actions (seeds, n, action) and their log densities (seeds, n).

        Args:
            observation: (seeds, n, observation).
            noise: normal numbers (seeds, n, action).
        """
        mean, log_std = self(observation)
        before = mean + noise * log_std.exp()
        density = -0.5 * noise**2 - log_std - 0.5 * math.log(2.0 * math.pi)
        # log(1 - tanh(x)^2), without loss of digits.
        slope = 2.0 * (math.log(2.0) - before - nn.functional.softplus(-2.0 * before))
        return torch.tanh(before), (density - slope).sum(-1)

    def mean(self, observation: Tensor) -> Tensor:
        """The action (seeds, n, action) without noise."""
        return torch.tanh(self(observation)[0])


class Critics(nn.Module):
    """Estimates of the return of an action, by critics that lie beside each other as seeds do.

    Attributes:
        number: of critics of each seed.
        seen: makes of observations what the network takes.
        body: the network, of all critics of a seed, then of the next.
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
        seen: nn.Module | None = None,
    ):
        super().__init__()
        self.number, self.seen = number, seen or nn.Identity()
        each = [source for source in sources for _ in range(number)]
        self.body = MLP(each, [observation + action, *hidden, 1], norm=norm)

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Of (seeds, n, ...): (number, seeds, n)."""
        both = torch.cat([self.seen(observation), action], dim=-1).repeat_interleave(self.number, 0)
        return self.body(both)[..., 0].unflatten(0, (-1, self.number)).transpose(0, 1)


class DeterministicPolicy(nn.Module):
    """The best action of one seed, by the `mean` of a network, of observations (n, k)."""

    def __init__(self, actor: nn.Module, seed: int):
        super().__init__()
        self.actor = copy.deepcopy(actor).cpu()
        seen = (one for one in self.actor.modules() if isinstance(one, ObservationNormalizer))
        for array in (*self.actor.parameters(), *(b for one in seen for b in one.buffers())):
            array.data = array.data[seed : seed + 1].clone()  # Other buffers are of no seed.
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
