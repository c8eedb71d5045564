"""World models with latents (recurrent state-space models: Hafner et al., 2019) of several seeds.

Layers are those of SoftGym's authors (softagent's `planet/models.py`), with PyTorch's own first
weights. They are written here as torchrl's RSSM modules hold one seed, have ELU for ReLU and bound
deviations where the authors add to them.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from softgym_mj.learning.methods.planet.layers import GRU, Decoder, Dense, Encoder, dense_layers
from softgym_mj.learning.networks import drawn

_LEAST = 0.1  # Deviation of a latent (authors' code).


class Gaussian(NamedTuple):
    """Independent normal numbers (..., latent)."""

    mean: Tensor
    deviation: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """Returns those that standard normal ones become."""
        return self.mean + self.deviation * noise

    def divergence(self, other: "Gaussian") -> Tensor:
        """Kullback and Leibler's, of this from the other (...) [nats]."""
        ratio = (self.deviation / other.deviation) ** 2
        distance = ((self.mean - other.mean) / other.deviation) ** 2
        return 0.5 * (ratio + distance - 1.0 - ratio.log()).sum(-1)


class Path(NamedTuple):
    """What a stretch of env steps led to (seeds, n, steps, ...)."""

    belief: Tensor
    latent: Tensor
    prior: Gaussian
    posterior: Gaussian


class WorldModel(nn.Module):
    """Predicts images and rewards from actions; all arrays begin (seeds, n).

    A state is a belief, which follows from the past, and a latent, which is drawn.

    Attributes:
        encoder, decoder: of images.
        action, belief, latent: sizes.
    """

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        image_size: int,
        action: int,
        *,
        belief: int,
        latent: int,
        hidden: int,
        channels: int,
        kind: torch.dtype = torch.float32,
    ):
        """Draws the weights.

        Args:
            sources: of random numbers, one a seed.
            image_size: height and width [pixels].
            action, belief, latent, hidden: sizes, the last of hidden layers.
            channels: of the encoder's last layer.
            kind: precision of convolutions; weights and all else are float32.

        Raises:
            InvalidArgumentError: for images that layers do not halve down to 2 x 2.
        """
        super().__init__()
        features, embedding = belief + latent, 4 * channels
        self.encoder = Encoder(sources, image_size, channels, kind)
        self.decoder = Decoder(sources, image_size, features, embedding, channels, kind)
        self.action, self.belief, self.latent = action, belief, latent
        self._join = Dense(sources, latent + action, belief)
        self._cell = GRU(sources, belief, belief)
        self._prior = dense_layers(sources, belief, hidden, 2 * latent)
        self._posterior = dense_layers(sources, belief + embedding, hidden, 2 * latent)
        self._reward = dense_layers(sources, features, hidden, hidden, 1)
        self._one_step, self._one_guess = self._step, self._guess

    def fuse(self) -> None:
        """Compiles what is done again and again in time, in updates and in plans."""
        self._one_step = torch.compile(self._step, dynamic=False)
        self._one_guess = torch.compile(self._guess)

    def nothing(self, number: int) -> tuple[Tensor, Tensor]:
        """Belief and latent (seeds, number, ...) before anything is seen."""
        zeros = self._join.weight.new_zeros(len(self._join.weight), number, 1)
        return zeros.expand(-1, -1, self.belief), zeros.expand(-1, -1, self.latent)

    def advance(self, belief: Tensor, latent: Tensor, action: Tensor) -> Tensor:
        """Returns the belief after an action."""
        joined = self._join(torch.cat([latent, action], dim=-1))
        return self._cell(functional.relu(joined), belief)

    def prior(self, belief: Tensor) -> Gaussian:
        """Returns the latent that is expected."""
        return _gaussian(self._prior(belief))

    def posterior(self, belief: Tensor, embedding: Tensor) -> Gaussian:
        """Returns the latent of what is seen, by the encoder."""
        return _gaussian(self._posterior(torch.cat([belief, embedding], dim=-1)))

    def reward(self, belief: Tensor, latent: Tensor) -> Tensor:
        """Of the step that led to the state (seeds, n)."""
        return self._reward(torch.cat([belief, latent], dim=-1))[..., 0]

    def image(self, belief: Tensor, latent: Tensor) -> Tensor:
        """What is seen in the state (seeds, n, size, size, 3), in -0.5..0.5."""
        return self.decoder(torch.cat([belief, latent], dim=-1))

    def observe(self, image: Tensor, action: Tensor, ended: Tensor, noise: Tensor) -> Path:
        """Follows stretches of env steps by what is seen.

        The state before a stretch is zero; so is that before each episode which begins in it.

        Args:
            image: after each step (seeds, n, steps, size, size, 3), in -0.5..0.5.
            action: of each step (seeds, n, steps, action).
            ended: whether another episode follows (seeds, n, steps).
            noise: of the latents (seeds, n, steps, latent).
        """
        # All that does not depend on the step before is done for all steps at once.
        embedding = self.encoder(image.flatten(1, 2))
        first = self._posterior[0]
        action_part = action.flatten(1, 2) @ self._join.weight[:, self.latent :] + self._join.bias
        seen = embedding @ first.weight[:, self.belief :] + first.bias
        lead = image.shape[1:3]
        action_part, seen = action_part.unflatten(1, lead), seen.unflatten(1, lead)
        going = torch.cat([torch.zeros_like(ended[:, :, :1]), ended[:, :, :-1]], 2).logical_not()
        going = going[..., None].float()
        # They need a gradient as later ones do, so that one program serves all steps.
        belief, latent = (
            zeros.contiguous().requires_grad_(torch.is_grad_enabled())
            for zeros in self.nothing(lead[0])
        )
        steps = []
        for t in range(lead[1]):
            own = action_part[:, :, t], seen[:, :, t], noise[:, :, t], going[:, :, t]
            steps.append(self._one_step(belief, latent, *own))
            belief, latent = steps[-1][:2]
        beliefs, latents, *both = (torch.stack(each, 2) for each in zip(*steps, strict=True))
        prior = Gaussian(*(each.unflatten(1, lead) for each in self.prior(beliefs.flatten(1, 2))))
        return Path(beliefs, latents, prior, Gaussian(*both))

    def _step(
        self,
        belief: Tensor,
        latent: Tensor,
        action_part: Tensor,
        seen: Tensor,
        noise: Tensor,
        going: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Returns belief, latent, and mean and deviation of the latent, after an env step.

        Args:
            belief, latent: before.
            action_part, seen: Shares of action and image in the first layers (seeds, n, ...).
            noise: of the latent.
            going: 0 where an episode begins, else 1 (seeds, n, 1).
        """
        joined = torch.bmm(going * latent, self._join.weight[:, : self.latent]) + action_part
        belief = self._cell(functional.relu(joined), going * belief)
        first, *others = self._posterior
        x = torch.bmm(belief, first.weight[:, : self.belief]) + seen
        for layer in others:
            x = layer(x)
        posterior = _gaussian(x)
        return belief, posterior.sample(noise), *posterior

    def imagine(
        self,
        belief: Tensor,
        latent: Tensor,
        actions: Iterable[Tensor],
        sources: Sequence[torch.Generator] | None = None,
    ) -> Iterator[tuple[Tensor, Tensor]]:
        """Yields belief and latent after each action (seeds, n, action), without seeing anything.

        Args:
            belief, latent: (seeds, n, ...) before.
            actions: one after the other.
            sources: of latents; None for their means.
        """
        for action in actions:
            belief = self.advance(belief, latent, action)
            prior = self.prior(belief)
            latent = prior.sample(drawn(sources, *latent.shape[1:])) if sources else prior.mean
            yield belief, latent

    def guess(
        self, belief: Tensor, latent: Tensor, action: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns belief, latent and reward (seeds, n) after an action, without seeing anything.

        Args:
            belief, latent: (seeds, n, ...) before.
            action: (seeds, n, action).
            noise: of the latent (seeds, n, latent).
        """
        return self._one_guess(belief, latent, action, noise)

    def _guess(
        self, belief: Tensor, latent: Tensor, action: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        belief = self.advance(belief, latent, action)
        latent = self.prior(belief).sample(noise)
        return belief, latent, self.reward(belief, latent)


def centered(frames: Tensor, bits: int, shares: Tensor | float = 0.5) -> Tensor:
    """Frames (uint8) in steps of so many bits, in -0.5..0.5 (Kingma and Dhariwal, 2018).

    Args:
        frames: of any shape.
        bits: 1..8.
        shares: where in its step each number lies, in 0..1, so that no step is sharp.
    """
    step = 2.0 ** (8 - bits)
    return ((frames.float() / step).floor() + shares) / 2.0**bits - 0.5


def _gaussian(numbers: Tensor) -> Gaussian:
    mean, deviation = numbers.chunk(2, dim=-1)
    return Gaussian(mean, functional.softplus(deviation) + _LEAST)
