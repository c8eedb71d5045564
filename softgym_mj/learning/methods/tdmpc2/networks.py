"""TD-MPC2's implicit world model (Hansen et al., 2024), for several seeds.

It predicts latent states, rewards and values, without a decoder. Seeds and critics share a
dimension of the critics' arrays, so that one matrix product computes all.
"""

import copy
import dataclasses
import itertools
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.methods.tdmpc2.two_hot import expected
from softgym_mj.learning.networks import Actor, LayerNorm, Linear, drawn
from softgym_mj.validation import typed

_WEIGHT_STD = 0.02  # Initial standard deviation of weights (published code).


@typed
@dataclasses.dataclass(frozen=True)
class WorldModelSettings:
    """Sizes of the world model; the defaults are the published model of 5 million parameters.

    Attributes:
        latent: Size of a latent state.
        simplex: Size of a softmax group of a latent state.
        encoder: Size of the encoder's hidden layer.
        hidden: Sizes of the hidden layers of all other networks.
        critics: Number of critics.
        bins: Number of bins of rewards and values (`two_hot`).
        dropout: Dropout rate of a critic's first hidden layer.
        log_std: Bounds of the policy's log standard deviation.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    latent: int = 512
    simplex: int = 8
    encoder: int = 256
    hidden: tuple[int, ...] = (512, 512)
    critics: int = 5
    bins: int = 101
    dropout: float = 0.01
    log_std: tuple[float, float] = (-10.0, 2.0)

    def __post_init__(self):
        check_count("simplex", self.simplex, 1)
        check_count("encoder", self.encoder, 1)
        for name in ("critics", "bins"):
            check_count(name, getattr(self, name), 2)
        if check_count("latent", self.latent, 1) % self.simplex:
            raise InvalidArgumentError("latent", self.latent, f"{self.simplex} times a number")
        if not self.hidden or min(self.hidden) < 1:
            raise InvalidArgumentError("hidden", self.hidden, "sizes of one layer or more")
        check_number("dropout", self.dropout, ge=0.0, lt=1.0)
        if self.log_std[0] >= self.log_std[1]:
            raise InvalidArgumentError("log_std", self.log_std, "(least, largest)")


class NormedMLP(nn.Module):
    """Multilayer perceptron with LayerNorm and Mish; the output may be latent states."""

    def __init__(
        self, sources: Sequence[torch.Generator], sizes: Sequence[int], simplex: int | None = None
    ):
        """Draws the weights.

        Args:
            sources: Random generators, one per network.
            sizes: Sizes of the input, of hidden layers and of the output.
            simplex: Size of the softmax groups of latent states; None for a linear output.
        """
        super().__init__()
        layers = [Linear(sources, *pair) for pair in itertools.pairwise(sizes)]
        for layer in layers:
            layer.weight.data = _WEIGHT_STD * drawn(sources, *layer.weight.shape[1:])
        normed = sizes[1:] if simplex else sizes[1:-1]
        norms = [LayerNorm(len(sources), size, sources[0].device) for size in normed]
        self.layers, self.norms = nn.ModuleList(layers), nn.ModuleList(norms)
        self._simplex = simplex

    def forward(self, x: Tensor, kept_mask: Tensor | None = None) -> Tensor:
        """Maps inputs (networks, n, inputs) to outputs (networks, n, outputs).

        Args:
            x: The inputs.
            kept_mask: Dropout factors of the first layer (networks, n, size).
        """
        last = len(self.layers) - 1
        for k, layer in enumerate(self.layers):
            x = layer(x)
            if k == 0 and kept_mask is not None:
                x = x * kept_mask
            if k < len(self.norms):
                x = self.norms[k](x)
            if k < last:
                x = nn.functional.mish(x)
        return x if self._simplex is None else simplicial(x, self._simplex)


def simplicial(x: Tensor, size: int) -> Tensor:
    """Applies softmax to groups of `size` entries of the last dimension (SimNorm)."""
    return x.unflatten(-1, (-1, size)).softmax(-1).flatten(-2)


class WorldModel(nn.Module):
    """World model of all seeds, with inputs (seeds, ..., size).

    Attributes:
        settings: Sizes of the networks.
        encoder, dynamics, reward, critics: The networks.
        targets: Target critics.
        actor: The policy prior.
    """

    def __init__(
        self,
        settings: WorldModelSettings,
        sources: Sequence[torch.Generator],
        observation: int,
        action: int,
    ):
        super().__init__()
        latent, hidden, bins = settings.latent, settings.hidden, settings.bins
        both, own = latent + action, settings
        self.settings = settings
        self.encoder = NormedMLP(sources, [observation, own.encoder, latent], own.simplex)
        self.dynamics = NormedMLP(sources, [both, *hidden, latent], own.simplex)
        self.reward = NormedMLP(sources, [both, *hidden, bins])
        each = [source for source in sources for _ in range(own.critics)]
        self.critics = NormedMLP(each, [both, *hidden, bins])
        self.actor = Actor(sources, latent, action, (), own.log_std)
        self.actor.body = NormedMLP(sources, [latent, *hidden, 2 * action])
        for network in (self.reward, self.critics):  # Initial rewards and values are 0.
            nn.init.zeros_(network.layers[-1].weight)
        self.targets = copy.deepcopy(self.critics).requires_grad_(False)

    def encode(self, observation: Tensor) -> Tensor:
        """Returns latent states (seeds, ..., latent) of observations."""
        return _each(self.encoder, observation)

    def following(self, latent: Tensor, action: Tensor) -> Tensor:
        """Returns latent states after actions (seeds, ..., action)."""
        return _each(self.dynamics, torch.cat([latent, action], dim=-1))

    def rewards(self, latent: Tensor, action: Tensor) -> Tensor:
        """Returns logits (seeds, ..., bins) of rewards of actions."""
        return _each(self.reward, torch.cat([latent, action], dim=-1))

    def values(
        self,
        latent: Tensor,
        action: Tensor,
        kept_mask: Tensor | None = None,
        *,
        target: bool = False,
    ) -> Tensor:
        """Returns logits (seeds, critics, ..., bins) of returns of actions.

        Args:
            latent: Latent states.
            action: Actions.
            kept_mask: Value of `dropout`; None for no dropout.
            target: Whether to use the target critics.
        """
        number, (seeds, *middle) = self.settings.critics, latent.shape[:-1]
        both = torch.cat([latent, action], dim=-1).flatten(1, -2)
        inputs = both[:, None].expand(-1, number, -1, -1).flatten(0, 1)
        return (self.targets if target else self.critics)(inputs, kept_mask).reshape(
            seeds, number, *middle, -1
        )

    def sample(self, latent: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the policy's actions (seeds, ..., action) and log densities (seeds, ...)."""
        middle = latent.shape[1:-1]
        action, density = self.actor.sample(latent.flatten(1, -2), noise.flatten(1, -2))
        return action.unflatten(1, middle), density.unflatten(1, middle)

    def dropout(self, sources: Sequence[torch.Generator], number: int) -> Tensor:
        """Returns dropout factors for `values` of a number of states."""
        share, sizes = self.settings.dropout, (self.settings.critics, number)
        numbers = drawn(sources, *sizes, self.settings.hidden[0], normal=False)
        return (numbers >= share).flatten(0, 1) / (1.0 - share)


def _each(network: nn.Module, x: Tensor) -> Tensor:
    return network(x.flatten(1, -2)).unflatten(1, x.shape[1:-1])


def two_of(logits: Tensor, pair: Tensor) -> Tensor:
    """Returns the logits of two critics (seeds, 2, ...), by their indices (seeds, 2)."""
    return logits[torch.arange(len(pair), device=pair.device)[:, None], pair]


def imagined(
    model: WorldModel, latent: Tensor, actions: Tensor, noise: Tensor, pair: Tensor, discount: float
) -> Tensor:
    """Predicts returns (seeds, ...) of action sequences, which the policy continues.

    Args:
        model: The networks.
        latent: Initial latent states (seeds, ..., latent).
        actions: Action sequences (seeds, ..., horizon, action).
        noise: Noise of the policy's action at the end (seeds, ..., action).
        pair: Indices of two critics of each seed (seeds, 2), which are averaged.
        discount: Discount per env step.
    """
    result, factor = torch.zeros_like(noise[..., 0]), 1.0
    for action in actions.unbind(-2):
        result = result + factor * expected(model.rewards(latent, action))
        latent = model.following(latent, action)
        factor *= discount
    last, _ = model.sample(latent, noise)
    return result + factor * expected(two_of(model.values(latent, last), pair)).mean(1)


class Prior(nn.Module):
    """Encoder and policy prior of a model."""

    def __init__(self, model: WorldModel):
        super().__init__()
        self.encoder, self.actor = model.encoder, model.actor

    def mean(self, observation: Tensor) -> Tensor:
        """Returns the actions (seeds, n, action) without noise."""
        return self.actor.mean(self.encoder(observation))
