"""CURL (Laskin et al., 2020): soft actor-critic from images with a contrastive loss.

The loss makes features of two crops of an image more similar than those of other images. Details
are the paper's (softagent's `curl/curl_sac.py`): the policy acts on center crops, critics learn
from the first crop, and two optimizers minimize the contrastive loss, one of the encoder and one of
encoder and bilinear matrix. Crops start at any pixel; the paper's code omits the last ones.
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
    """Settings of CURL; the defaults are the paper's for most tasks.

    Attributes:
        crop: Height and width of crops [pixels].
        encoder_rate: Learning rate of the contrastive loss.
        encoder_tau: Polyak coefficient of the target encoder.

    Raises:
        InvalidArgumentError: for a value out of range.
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
    """Bilinear similarity of features, with a matrix of each seed, initially uniform in 0..1."""

    def __init__(self, sources: Sequence[torch.Generator], features: int):
        super().__init__()
        self.weight = nn.Parameter(drawn(sources, features, features, normal=False))

    def forward(self, anchors: Tensor, others: Tensor) -> Tensor:
        """Returns similarities (seeds, n, n) of features (seeds, n, features), a row an anchor."""
        return anchors @ self.weight @ others.mT


class CURL(PixelSAC):
    """Soft actor-critic on crops, with a contrastive loss.

    Attributes:
        contrast: Bilinear similarity of features.
    """

    settings: CURLSettings

    def __init__(
        self,
        settings: CURLSettings,
        seeds: Sequence[int],
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks; arguments are those of `PixelSAC`."""
        super().__init__(settings, seeds, (settings.crop, settings.crop), action, device)
        self.contrast = Contrast(self.sources, settings.features)
        weights, rate = [*self.critics.seen.parameters()], settings.encoder_rate
        self._encoder_adam = adam(weights, rate)
        self._contrast_adam = adam([*weights, *self.contrast.parameters()], rate)

    def update(self, batch: Batch) -> dict[str, Tensor]:
        anchor, following, other = (
            cropped(pictures, self._size, drawn(self.sources, 2, pictures.shape[1], normal=False))
            for pictures in (batch.observation, batch.next_observation, batch.observation)
        )
        seen = dataclasses.replace(batch, observation=anchor, next_observation=following)
        result = super().update(seen)
        loss = self.contrastive_loss(anchor, other)
        step(self._contrast_adam, loss)
        self._encoder_adam.step()  # Uses the same gradients.
        return result | {"contrastive_loss": loss.detach()}

    def contrastive_loss(self, anchors: Tensor, others: Tensor) -> Tensor:
        """Returns the InfoNCE loss (seeds,) of finding an anchor's other crop in the batch.

        Args:
            anchors: Crops (seeds, n, height, width, 3).
            others: Crops of the same images, in the same order.
        """
        with torch.no_grad():
            keys = self.targets.seen(others)
        # The cross entropy subtracts the maximum of each row internally.
        shares = self.contrast(self.critics.seen(anchors), keys).log_softmax(-1)
        return -shares.diagonal(dim1=-2, dim2=-1).mean(-1)

    def _update_targets(self) -> None:
        polyak_update(self.targets.body, self.critics.body, self.settings.tau)
        polyak_update(self.targets.seen, self.critics.seen, self.settings.encoder_tau)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        return super().get_state() | {"contrast": copy.deepcopy(self.contrast.state_dict())}

    def set_state(self, state: Mapping[str, Any]) -> None:
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
        raise InvalidArgumentError("crop", settings.crop, f"at most {size}, the image size")
    curl = CURL(settings, problem.seeds, problem.action, problem.device)
    return OffPolicy(settings, problem, curl)
