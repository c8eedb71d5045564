"""Asymmetric soft actor-critic (Pinto et al., 2018): the actor sees images, critics see the state.

Only training needs critics, and only simulation trains: there the state is known. What an action is
worth is learned as fast as from states, and convolutions are part of the actor alone. Images are
small, the means of squares of pixels, so that convolutions do not limit the number of updates.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.pixels import LEAST, Convolutions, cropped
from softgym_mj.learning.methods.sac import (
    LEAST_DEVIATION,
    SAC,
    STANDARD_SAMPLE,
    StateSACSettings,
)
from softgym_mj.learning.networks import (
    Actor,
    Critics,
    DeterministicPolicy,
    LayerNorm,
    Linear,
    ObservationNormalizer,
    drawn,
)
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed

Observation = Mapping[str, Tensor]


@typed
@dataclasses.dataclass(frozen=True)
class AsymmetricSettings(StateSACSettings):
    """How actor and critics learn.

    Attributes:
        privileged: name of the observation that critics take, such as "markov".
        square: side of the squares of an image whose means the actor sees [pixels].
        shift: largest random shift of images in each direction, in updates [pixels].
        channels: number of filters of each convolution.
        features: size of the encoding of an image.
        bfloat16: whether convolutions calculate in bfloat16 on a GPU, with weights of 32 bits.

    Raises:
        InvalidArgumentError: for a number out of range.
    """

    privileged: str = "markov"
    square: int = 2
    shift: int = 4
    channels: int = 32
    features: int = 256
    bfloat16: bool = True

    def __post_init__(self):
        super().__post_init__()
        for name in ("square", "channels", "features"):
            check_count(name, getattr(self, name), 1)
        check_count("shift", self.shift, 0)
        for name in ("symmetric", "symmetrize_policy"):
            if getattr(self, name):
                raise InvalidArgumentError(name, True, "False: images are shown as they are")


class Encoder(nn.Module):
    """What the actor makes of an image and of other observations.

    Attributes:
        image: name of the image.
        others: names of the other observations.
        normalizer: standardizes the other observations.
        outputs: number of values of an encoding.
    """

    def __init__(
        self,
        settings: AsymmetricSettings,
        sources: Sequence[torch.Generator],
        shapes: Mapping[str, tuple[int, ...]],
    ):
        """Draws the weights.

        Args:
            settings: sizes.
            sources: of random numbers, one a seed.
            shapes: of a single observation by name.

        Raises:
            InvalidArgumentError: unless there is a single image, of at least 15 squares.
        """
        super().__init__()
        images = [name for name, shape in shapes.items() if len(shape) == 3]
        self.others = [name for name, shape in shapes.items() if len(shape) == 1]
        self._square = settings.square
        size = [side // settings.square for name in images[:1] for side in shapes[name][:2]]
        if len(images) != 1 or len(self.others) != len(shapes) - 1 or min(size) < LEAST:
            valid = f"one image (height, width, 3) of {LEAST * settings.square} or more pixels"
            raise InvalidArgumentError("observation", dict(shapes), f"{valid}, and other numbers")
        self.image, device = images[0], sources[0].device
        is_reduced = settings.bfloat16 and device.type == "cuda"
        kind = torch.bfloat16 if is_reduced else torch.float32
        self.convolutions = Convolutions(sources, settings.channels, (size[0], size[1]), kind)
        norm = LayerNorm(len(sources), settings.features, device)
        linear = Linear(sources, self.convolutions.outputs, settings.features)
        self.head = nn.Sequential(linear, norm, nn.Tanh())
        size_of_others = sum(shapes[name][0] for name in self.others)
        self.normalizer = ObservationNormalizer(len(sources), size_of_others, device)
        self.outputs = settings.features + size_of_others

    def forward(self, observation: Observation) -> Tensor:
        """Returns encodings (seeds, n, outputs) of images (seeds, n, height, width, 3)."""
        encoded = self.head(self.convolutions(squares(observation[self.image], self._square)))
        if not self.others:
            return encoded
        return torch.cat([encoded, self.normalizer(self.beside(observation))], -1)

    def beside(self, observation: Observation) -> Tensor:
        """Returns all other observations (seeds, n, k)."""
        return torch.cat([observation[name].float() for name in self.others], -1)


def squares(pictures: Tensor, side: int) -> Tensor:
    """Returns means of squares of pixels.

    Args:
        pictures: (..., height, width, 3); rows and columns beyond the last whole square are left.
        side: of a square [pixels].

    Returns:
        (..., height // side, width // side, 3), in the units of the pictures.
    """
    rows, columns = (length // side for length in pictures.shape[-3:-1])
    whole = pictures[..., : rows * side, : columns * side, :].float()
    return whole.unflatten(-2, (columns, side)).unflatten(-4, (rows, side)).mean((-4, -2))


class State(nn.Module):
    """What critics see: one observation of several, standardized."""

    def __init__(self, name: str, normalizer: ObservationNormalizer):
        super().__init__()
        self.name, self.normalizer = name, normalizer

    def forward(self, observation: Observation) -> Tensor:
        """Returns (seeds, n, k)."""
        return self.normalizer(observation[self.name])


class Best(DeterministicPolicy):
    """The best action (n, action) of one seed, of observations of a policy's file by name."""

    def __init__(self, actor: nn.Module, seed: int):
        super().__init__(actor, seed)
        self.actor.seen.convolutions.kind = torch.float32

    def forward(self, observation: Observation) -> Tensor:
        """Returns actions; images are (n, 1, height, width, 3)."""
        newest = {
            name: (array[:, -1] if array.ndim > 2 else array)[None]
            for name, array in observation.items()
        }
        return self.actor.mean(newest)[0]


class AsymmetricSAC(SAC):
    """Actors that see images and critics that see states, of observations by name."""

    settings: AsymmetricSettings

    def __init__(
        self,
        settings: AsymmetricSettings,
        seeds: Sequence[int],
        shapes: Mapping[str, tuple[int, ...]],
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks.

        Args:
            settings: how they learn.
            seeds: of the random numbers, each of a training of its own.
            shapes: of a single observation by name.
            action: size of an action.
            device: of PyTorch.
        """
        self._shapes = {**shapes}
        (state,) = self._shapes.pop(settings.privileged)
        super().__init__(settings, seeds, state, action, device)

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        settings, sources = self.settings, self.sources
        encoder = Encoder(settings, sources, self._shapes)
        state = State(
            settings.privileged, ObservationNormalizer(len(sources), observation, sources[0].device)
        )
        actor = Actor(sources, encoder.outputs, action, settings.hidden, settings.log_std, encoder)
        critics = Critics(
            sources, observation, action, settings.hidden, norm=settings.norm,
            number=self.number_of_critics, seen=state,
        )  # fmt: skip
        return actor, critics

    def begin(self, sample: Callable[[int], Batch]) -> None:
        """Standardizes by means and deviations of the random env steps."""
        observation = sample(STANDARD_SAMPLE).observation
        for critics in (self.critics, self.targets):
            critics.seen.normalizer.fit(observation[self.settings.privileged], LEAST_DEVIATION)
        if self.actor.seen.others:
            self.actor.seen.normalizer.fit(self.actor.seen.beside(observation), LEAST_DEVIATION)

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Learns from a batch with images shifted; returns losses (seeds,) by name."""
        observation, following = map(self._shifted, (batch.observation, batch.next_observation))
        shifted = dataclasses.replace(batch, observation=observation, next_observation=following)
        return super().update(shifted)

    def _shifted(self, observation: Observation) -> Observation:
        image = self.actor.seen.image
        pictures = observation[image]
        shares = drawn(self.sources, 2, pictures.shape[1], normal=False)
        moved = cropped(pictures, tuple(pictures.shape[2:4]), shares, self.settings.shift)
        return {**observation, image: moved}

    def policy(self, seed: int) -> nn.Module:
        """Returns the actor of the seed at a place, on the CPU."""
        return Best(self.actor, seed)


def make(settings: AsymmetricSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for observations without a single image.
    """
    sac = AsymmetricSAC(settings, problem.seeds, problem.shapes, problem.action, problem.device)
    return OffPolicy(settings, problem, sac)
