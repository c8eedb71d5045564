"""World models (recurrent state-space models, Hafner et al., 2019) of several seeds.

Layers are those of SoftGym's authors (softagent's `planet/models.py`), with PyTorch's default
initialization. torchrl's RSSM modules support a single seed, use ELU instead of ReLU, and clamp
standard deviations where the authors add a minimum.
"""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from softgym_mj.learning.methods.planet.layers import GRU, Decoder, Dense, Encoder, dense_layers

_LEAST = 0.1  # Minimum standard deviation of a latent (authors' code).


class Gaussian(NamedTuple):
    """Diagonal Gaussian distribution (..., latent)."""

    mean: Tensor
    deviation: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """Returns a sample, from standard normal noise."""
        return self.mean + self.deviation * noise

    def divergence(self, other: "Gaussian") -> Tensor:
        """Returns the KL divergence from the other distribution (...) [nats]."""
        ratio = (self.deviation / other.deviation) ** 2
        distance = ((self.mean - other.mean) / other.deviation) ** 2
        return 0.5 * (ratio + distance - 1.0 - ratio.log()).sum(-1)


class Path(NamedTuple):
    """States of a sequence of env steps (seeds, n, steps, ...)."""

    belief: Tensor
    latent: Tensor
    prior: Gaussian
    posterior: Gaussian


class WorldModel(nn.Module):
    """World model that predicts images and rewards from actions; arrays begin with (seeds, n).

    A state consists of a deterministic belief and a stochastic latent.

    Attributes:
        encoder, decoder: Encoder and decoder of images.
        action, belief, latent: Sizes.
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
            sources: Random generators, one per seed.
            image_size: Height and width of images [pixels].
            action, belief, latent, hidden: Sizes of action, belief, latent and hidden layers.
            channels: Channels of the encoder's last layer.
            kind: Data type of convolutions; all else is float32.

        Raises:
            InvalidArgumentError: for image sizes that are no power of two.
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
        """Compiles the time steps of updates and plans."""
        self._one_step = torch.compile(self._step, dynamic=False)
        self._one_guess = torch.compile(self._guess)

    def nothing(self, number: int) -> tuple[Tensor, Tensor]:
        """Returns the initial belief and latent (seeds, number, ...)."""
        zeros = self._join.weight.new_zeros(len(self._join.weight), number, 1)
        return zeros.expand(-1, -1, self.belief), zeros.expand(-1, -1, self.latent)

    def advance(self, belief: Tensor, latent: Tensor, action: Tensor) -> Tensor:
        """Returns the belief after an action."""
        joined = self._join(torch.cat([latent, action], dim=-1))
        return self._cell(functional.relu(joined), belief)

    def prior(self, belief: Tensor) -> Gaussian:
        """Returns the prior distribution of the latent."""
        return _gaussian(self._prior(belief))

    def posterior(self, belief: Tensor, embedding: Tensor) -> Gaussian:
        """Returns the posterior distribution of the latent, given the encoded image."""
        return _gaussian(self._posterior(torch.cat([belief, embedding], dim=-1)))

    def reward(self, belief: Tensor, latent: Tensor) -> Tensor:
        """Returns the predicted reward (seeds, n) of the step to the state."""
        return self._reward(torch.cat([belief, latent], dim=-1))[..., 0]

    def image(self, belief: Tensor, latent: Tensor) -> Tensor:
        """Returns the predicted image (seeds, n, size, size, 3), in -0.5..0.5."""
        return self.decoder(torch.cat([belief, latent], dim=-1))

    def observe(self, image: Tensor, action: Tensor, ended: Tensor, noise: Tensor) -> Path:
        """Returns the posterior states of sequences of env steps.

        The state is zero before a sequence and before each episode that starts within it.

        Args:
            image: Images after each step (seeds, n, steps, size, size, 3), in -0.5..0.5.
            action: Actions (seeds, n, steps, action).
            ended: Whether another episode follows (seeds, n, steps).
            noise: Noise of latents (seeds, n, steps, latent).
        """
        # Parts that do not depend on the previous step are computed for all steps at once.
        embedding = self.encoder(image.flatten(1, 2))
        first = self._posterior[0]
        action_part = action.flatten(1, 2) @ self._join.weight[:, self.latent :] + self._join.bias
        seen = embedding @ first.weight[:, self.belief :] + first.bias
        lead = image.shape[1:3]
        action_part, seen = action_part.unflatten(1, lead), seen.unflatten(1, lead)
        going = torch.cat([torch.zeros_like(ended[:, :, :1]), ended[:, :, :-1]], 2).logical_not()
        going = going[..., None].float()
        # Initial states require gradients as later ones do, so that one compiled function fits all.
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
            belief, latent: State before the step.
            action_part, seen: Shares of action and image in the first layers (seeds, n, ...).
            noise: Noise of the latent.
            going: 0 at the start of an episode, otherwise 1 (seeds, n, 1).
        """
        joined = torch.bmm(going * latent, self._join.weight[:, : self.latent]) + action_part
        belief = self._cell(functional.relu(joined), going * belief)
        first, *others = self._posterior
        x = torch.bmm(belief, first.weight[:, : self.belief]) + seen
        for layer in others:
            x = layer(x)
        posterior = _gaussian(x)
        return belief, posterior.sample(noise), *posterior

    def guess(
        self, belief: Tensor, latent: Tensor, action: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns the predicted belief, latent and reward (seeds, n) after an action.

        Args:
            belief, latent: State before the action (seeds, n, ...).
            action: Actions (seeds, n, action).
            noise: Noise of the latent (seeds, n, latent).
        """
        return self._one_guess(belief, latent, action, noise)

    def _guess(
        self, belief: Tensor, latent: Tensor, action: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        belief = self.advance(belief, latent, action)
        latent = self.prior(belief).sample(noise)
        return belief, latent, self.reward(belief, latent)


def centered(frames: Tensor, bits: int, shares: Tensor | float = 0.5) -> Tensor:
    """Quantizes frames (uint8) to `bits` and scales them to -0.5..0.5 (Kingma and Dhariwal, 2018).

    Args:
        frames: Frames of any shape.
        bits: Number of bits, 1..8.
        shares: Position of each number within its quantization step, 0..1 (dithering).
    """
    step = 2.0 ** (8 - bits)
    return ((frames.float() / step).floor() + shares) / 2.0**bits - 0.5


def _gaussian(numbers: Tensor) -> Gaussian:
    mean, deviation = numbers.chunk(2, dim=-1)
    return Gaussian(mean, functional.softplus(deviation) + _LEAST)
