"""Truncated quantile critics (TQC; Kuznetsov et al., 2020, arXiv:2005.04269), for several seeds.

Soft actor-critic whose critics return quantiles of the return. Targets are all quantiles of all
target critics but the largest, which keeps values from being overestimated; the actor maximizes
the mean of all quantiles.
"""

import dataclasses

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import check_count
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods import sac
from softgym_mj.learning.methods.sac import SAC, StateSACSettings
from softgym_mj.learning.networks import Actor, Critics
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class TQCSettings(StateSACSettings):
    """Settings of truncated quantile critics; numbers of critics and quantiles are the authors'.

    Attributes:
        critics: Number of critics.
        quantiles: Number of quantiles of each critic.
        dropped: Number of quantiles that targets leave out per critic; the largest of all critics'
            pooled quantiles.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    critics: int = 5
    quantiles: int = 25
    dropped: int = 2

    def __post_init__(self):
        super().__post_init__()
        check_count("critics", self.critics, 1)
        check_count("quantiles", self.quantiles, 1)
        check_count("dropped", self.dropped, 0, self.quantiles - 1)


def quantile_loss(quantiles: Tensor, targets: Tensor) -> Tensor:
    """Returns the quantile Huber loss (...) of quantiles (..., n) for targets (..., m).

    It is the mean over all pairs of |tau - [target < quantile]| times Huber's loss of their
    difference with a threshold of 1, where tau = (i + 1/2) / n for the quantile i.
    """
    number = quantiles.shape[-1]
    shares = (torch.arange(number, device=quantiles.device) + 0.5) / number
    apart = targets[..., None, :] - quantiles[..., :, None]
    huber = torch.where(apart.abs() > 1.0, apart.abs() - 0.5, 0.5 * apart**2)
    weights = (shares[:, None] - (apart < 0.0).to(apart.dtype)).abs()
    return (weights * huber).mean((-2, -1))


class TQC(SAC):
    """Soft actor-critic with truncated quantile critics."""

    settings: TQCSettings

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        settings, sizes = self.settings, (observation, action, self.settings.hidden)
        number, outputs = settings.critics, settings.quantiles
        return (
            Actor(self.sources, *sizes, settings.log_std),
            Critics(self.sources, *sizes, norm=settings.norm, number=number, outputs=outputs),
        )

    def _reduce_critics(self, values: Tensor) -> Tensor:
        """Returns means (seeds, n) of quantiles (critics, seeds, n, quantiles)."""
        return values.mean((0, -1))

    def critic_target(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns the kept quantiles (seeds, n, critics (quantiles - dropped)) of targets."""
        settings = self.settings
        with torch.no_grad():
            action, density = self.actor.sample(batch.next_observation, noise)
            values = self.targets(batch.next_observation, action).permute(1, 2, 0, 3).flatten(2)
            kept = settings.critics * (settings.quantiles - settings.dropped)
            values = values.sort(-1).values[..., :kept]
            values = values - self.alpha[:, None, None] * density[..., None]
            return batch.reward[..., None] + batch.discount[..., None] * values

    def critic_loss(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns the sum (seeds,) of all critics' mean losses, as `SAC.critic_loss`."""
        result = self.critics(batch.observation, batch.action)
        return quantile_loss(result, self.critic_target(batch, noise)).mean(-1).sum(0)


def make(settings: TQCSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem."""
    return sac.make(settings, problem, TQC)
