"""DrQ (Kostrikov et al., 2020): soft actor-critic from randomly shifted images.

Details are the paper's (softagent's `drq/Drq.py`): each image is shifted twice; targets are
averaged over both shifts of the next image, and losses over both shifts of the image.
"""

import dataclasses

from torch import Tensor

from softgym_mj.exceptions import check_count
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.pixels import PixelSAC, PixelSettings, cropped, picture_size
from softgym_mj.learning.networks import drawn
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed

_SHIFTS = 2  # Shifts of an image and of the next one: K = M = 2 in the paper.


@typed
@dataclasses.dataclass(frozen=True)
class DrQSettings(PixelSettings):
    """Settings of DrQ; the defaults are the paper's.

    Attributes:
        pad: Largest shift in each direction [pixels]; edges are repeated.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    alpha_beta: float = 0.9
    tanh: bool = True
    pad: int = 6

    def __post_init__(self):
        super().__post_init__()
        check_count("pad", self.pad, 0)


class DrQ(PixelSAC):
    """Soft actor-critic on shifted images.

    Batches of losses have all first shifts of images, then all second shifts.
    """

    settings: DrQSettings

    def update(self, batch: Batch) -> dict[str, Tensor]:
        return super().update(self._shifted(batch))

    def _shifted(self, batch: Batch) -> Batch:
        """Returns the batch (seeds, 2 n, ...) with images shifted."""
        whole = {
            name: value.repeat(1, _SHIFTS, *[1] * (value.ndim - 2))
            for name, value in vars(batch).items()
        }
        for name in ("observation", "next_observation"):
            shares = drawn(self.sources, 2, whole[name].shape[1], normal=False)
            whole[name] = cropped(whole[name], self._size, shares, self.settings.pad)
        return Batch(**whole)

    def critic_target(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns critic targets (seeds, 2 n), averaged over both shifts."""
        each = super().critic_target(batch, noise).unflatten(1, (_SHIFTS, -1))
        return each.mean(1).repeat(1, _SHIFTS)

    def critic_loss(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns the sum (seeds,) of squared errors of both critics and both shifts."""
        return _SHIFTS * super().critic_loss(batch, noise)

    def actor_losses(self, batch: Batch, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the losses of actor and entropy weight (seeds,), of first shifts."""
        half = batch.reward.shape[1] // _SHIFTS
        first = Batch(*(value[:, :half] for value in vars(batch).values()))
        return super().actor_losses(first, noise[:, :half])


def make(settings: DrQSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for a problem without images.
    """
    drq = DrQ(settings, problem.seeds, picture_size(problem), problem.action, problem.device)
    return OffPolicy(settings, problem, drq)
