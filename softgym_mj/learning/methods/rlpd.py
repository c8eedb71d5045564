"""Reinforcement learning with prior data (RLPD; Ball et al., 2023, arXiv:2302.02948).

SAC with demonstrations in half of each batch and an ensemble of critics with LayerNorm. Targets are
the minimum of a random subset of critics, and the actor maximizes the mean of all. Details are
those of the authors' code (github.com/ikostrikov/rlpd, `sac_learner.py`); log standard deviations
are bounded as in `sac`.
"""

import dataclasses
from collections.abc import Sequence

import torch
from torch import Tensor

from softgym_mj.exceptions import check_count
from softgym_mj.learning.demonstrations import check_demonstrations, collect, replay_of
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import SAC, StateSACSettings
from softgym_mj.learning.networks import drawn
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch, Replay
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class RLPDSettings(StateSACSettings):
    """Settings of RLPD; the defaults are the authors' for manipulation (Adroit), one environment.

    A batch has `batch` env steps of environments and as many demonstrated ones.

    Attributes:
        demonstrations: Number of the expert's episodes.
        jobs: Processes that play them; None for the number of cores.
        critics: Number of critics.
        least_of: Number of random critics whose minimum is the target.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    random_steps: int = 5_000
    updates: int = 20
    batch: int = 128
    replay: int = 1_000_000
    hidden: tuple[int, ...] = (256, 256, 256)
    norm: bool = True
    tau: float = 0.005
    actor_rate: float = 3e-4
    critic_rate: float = 3e-4
    alpha_rate: float = 3e-4
    alpha: float = 1.0
    alpha_beta: float = 0.9
    target_entropy: float = -0.5
    actor_every: int = 20
    target_every: int = 1
    demonstrations: int = 200
    jobs: int | None = None
    critics: int = 10
    least_of: int = 2

    def __post_init__(self):
        super().__post_init__()
        check_demonstrations(self.demonstrations, self.jobs)
        check_count("critics", self.critics, 1)
        check_count("least_of", self.least_of, 1, self.critics)


def least(values: Tensor, shares: Tensor, number: int) -> Tensor:
    """Returns the minimum (seeds, n) over a random subset of values (critics, seeds, n).

    Args:
        values: Values of all critics.
        shares: Random numbers (seeds, critics); the critics with the largest are selected.
        number: Size of the subset.
    """
    taken = shares.topk(number, dim=-1).indices.T  # (number, seeds)
    return values.gather(0, taken[..., None].expand(-1, -1, values.shape[-1])).amin(0)


class RLPD(SAC):
    """Soft actor-critic with ensembles of critics and demonstrations."""

    settings: RLPDSettings

    def __init__(
        self,
        settings: RLPDSettings,
        seeds: Sequence[int],
        shown: Replay,
        observation: int,
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks; `shown` has demonstrations, other arguments are those of `SAC`."""
        super().__init__(settings, seeds, observation, action, device)
        self._shown, self._own = shown, self.sources
        self.sources = [*self._own, *shown.sources]

    def _noise(self, *shape: int) -> Tensor:
        return drawn(self._own, *shape)

    def _judged(self, values: Tensor) -> Tensor:
        """Returns the mean (seeds, n) of the critics' values (critics, seeds, n)."""
        return values.mean(0)

    def critic_target(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns critic targets (seeds, n) with the minimum of a new random subset of critics."""
        settings = self.settings
        with torch.no_grad():
            action, _ = self.actor.sample(batch.next_observation, noise)
            values = self.targets(batch.next_observation, action)
            shares = drawn(self._own, settings.critics, normal=False)
            value = least(values, shares, settings.least_of)  # Without the entropy of the action.
            return batch.reward + batch.discount * value

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Makes one update from a batch and demonstrations; returns losses (seeds,) by name."""
        shown = self._shown.sample(batch.action.shape[1])
        pairs = zip(vars(batch).values(), vars(shown).values(), strict=True)
        return super().update(Batch(*(torch.cat(pair, dim=1) for pair in pairs)))


def make(settings: RLPDSettings, problem: Problem) -> OffPolicy:
    """Creates the learner of a problem, after collecting missing demonstrations."""
    shown = collect(problem, settings.demonstrations, settings.jobs)
    replay = replay_of(
        shown, problem.seeds, discount=settings.discount, steps=settings.n_step,
        symmetries=symmetries(problem.example()) if settings.symmetric else (),
    )  # fmt: skip
    (size,) = problem.observation
    rlpd = RLPD(settings, problem.seeds, replay, size, problem.action, problem.device)
    learner = OffPolicy(settings, problem, rlpd)
    replay.discount = learner.replay.discount  # Both share the tensor, which may change.
    return learner
