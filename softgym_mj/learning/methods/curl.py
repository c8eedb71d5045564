"""CURL (Laskin et al., 2020): soft actor-critic that also learns to tell images apart.

Features of two crops of one image are to be more alike than those of crops of others. With the
paper's details (softagent's `curl/curl_sac.py`): what acts sees the middle of images, critics learn
from the first crop, and the contrastive loss is followed by two optimizers, one of the encoder and
one of the encoder and the matrix that compares. A crop may begin at any place; the paper's code
leaves out the last ones.
"""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.pixels import LEAST, PixelSAC, PixelSettings, cropped, picture_size
from softgym_mj.learning.networks import drawn
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.optimization import adam, polyak_update, step
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class CURLSettings(PixelSettings):
    """How it learns; the defaults are the paper's, of most tasks.

    Attributes:
        crop: height and width of crops [pixels].
        encoder_rate: of Adam, of the contrastive loss.
        encoder_tau: share of the encoder in its targets, at each update of these.

    Raises:
        InvalidArgumentError: for numbers out of range.
    """

    actor_rate: float = 3e-4
    critic_rate: float = 3e-4
    crop: int = 100
    encoder_rate: float = 1e-3
    encoder_tau: float = 0.05

    def __post_init__(self):
        super().__post_init__()
        check_count("crop", self.crop, LEAST)
        for name in ("encoder_rate", "encoder_tau"):
            check_number(name, getattr(self, name), gt=0.0, le=1.0)


class Contrast(nn.Module):
    """Compares features by a matrix of each seed, with numbers in 0..1 at first."""

    def __init__(self, sources: Sequence[torch.Generator], features: int):
        super().__init__()
        self.weight = nn.Parameter(drawn(sources, features, features, normal=False))

    def forward(self, anchors: Tensor, others: Tensor) -> Tensor:
        """How alike those of (seeds, n, features) are: (seeds, n, n), a row for each anchor."""
        return anchors @ self.weight @ others.mT


class CURL(PixelSAC):
    """Actors and critics that see crops, and their contrastive loss.

    Attributes:
        contrast: what compares features.
    """

    settings: CURLSettings

    def __init__(
        self,
        settings: CURLSettings,
        seeds: Sequence[int],
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks; arguments as of `PixelSAC`."""
        super().__init__(settings, seeds, (settings.crop, settings.crop), action, device)
        self.contrast = Contrast(self.sources, settings.features)
        weights, rate = [*self.critics.encoder.parameters()], settings.encoder_rate
        self._encoder_adam = adam(weights, rate)
        self._contrast_adam = adam([*weights, *self.contrast.parameters()], rate)

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Learns from a batch of images; returns losses and the like (seeds,) by name."""
        anchor, following, other = (
            cropped(pictures, self._size, drawn(self.sources, 2, pictures.shape[1], normal=False))
            for pictures in (batch.observation, batch.next_observation, batch.observation)
        )
        seen = dataclasses.replace(batch, observation=anchor, next_observation=following)
        result = super().update(seen)
        loss = self.contrastive_loss(anchor, other)
        step(self._contrast_adam, loss)
        self._encoder_adam.step()  # By the same gradients.
        return result | {"contrastive_loss": loss.detach()}

    def contrastive_loss(self, anchors: Tensor, others: Tensor) -> Tensor:
        """Of each seed (seeds,): how hard it is to find an anchor's other crop among all.

        Args:
            anchors: crops (seeds, n, height, width, 3).
            others: crops of the same images, in the same order.
        """
        with torch.no_grad():
            keys = self.targets.encoder(others)
        # Cross entropy; what is largest in a row is subtracted inside.
        shares = self.contrast(self.critics.encoder(anchors), keys).log_softmax(-1)
        return -shares.diagonal(dim1=-2, dim2=-1).mean(-1)

    def _follow(self) -> None:
        polyak_update(self.targets.critics, self.critics.critics, self.settings.tau)
        polyak_update(self.targets.encoder, self.critics.encoder, self.settings.encoder_tau)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns all that `set_state` needs to go on with the same numbers."""
        return super().get_state() | {"contrast": copy.deepcopy(self.contrast.state_dict())}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Goes on from what `get_state` returned."""
        super().set_state(state)
        self.contrast.load_state_dict(state["contrast"])

    @property
    def _adams(self) -> tuple[torch.optim.Adam, ...]:
        return *super()._adams, self._encoder_adam, self._contrast_adam


def make(settings: CURLSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for a problem without images, or crops larger than these.
    """
    size = min(picture_size(problem))
    if settings.crop > size:
        raise InvalidArgumentError("crop", settings.crop, f"{size} or less, as images are")
    curl = CURL(settings, problem.seeds, problem.action, problem.device)
    return OffPolicy(settings, problem, curl)
