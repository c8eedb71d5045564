"""Reinforcement learning with prior data (RLPD; Ball et al., 2023, arXiv:2302.02948).

SAC of which half a batch are demonstrations, with an ensemble of normalized critics: targets are
the least of a few that are drawn for each update, and the actor follows the mean of all. Details
are those of the authors' code (github.com/ikostrikov/rlpd, `sac_learner.py`); deviations are
bounded as in SAC here.
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
    """How it learns; the defaults are the authors', of manipulation (Adroit), for one environment.

    `batch` counts env steps of environments, which come with as many demonstrated ones.

    Attributes:
        demonstrations: episodes of the expert.
        jobs: processes that play them; None for as many as there are cores.
        critics: how many.
        least_of: of how many the least is a target.
        backup_entropy: whether targets have the entropy of next actions.
        min_q_weight: of what the actor follows; targets have `least_of`.

    Raises:
        InvalidArgumentError: for numbers out of range.
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
    min_q_weight: float = 0.0
    actor_every: int = 20
    target_every: int = 1
    demonstrations: int = 200
    jobs: int | None = None
    critics: int = 10
    least_of: int = 2
    backup_entropy: bool = False

    def __post_init__(self):
        super().__post_init__()
        check_demonstrations(self.demonstrations, self.jobs)
        check_count("critics", self.critics, 1)
        check_count("least_of", self.least_of, 1, self.critics)


def least(values: Tensor, shares: Tensor, number: int) -> Tensor:
    """Returns the least (seeds, n) of so many of the values (critics, seeds, n).

    Args:
        values: of all.
        shares: random numbers (seeds, critics): the critics of the largest ones are taken.
        number: of critics.
    """
    taken = shares.topk(number, dim=-1).indices.T  # (number, seeds)
    return values.gather(0, taken[..., None].expand(-1, -1, values.shape[-1])).amin(0)


class RLPD(SAC):
    """Actors and ensembles of critics that are trained side by side."""

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
        """Draws the networks.

        Args:
            settings: how it learns.
            seeds: of the random numbers, each of a training of its own.
            shown: demonstrations.
            observation, action: sizes.
            device: where.
        """
        super().__init__(settings, seeds, observation, action, device)
        self._shown, self._own = shown, self.sources
        self.sources = [*self._own, *shown.sources]

    @property
    def number_of_critics(self) -> int:
        """See `SAC`."""
        return self.settings.critics

    def _noise(self, *shape: int) -> Tensor:
        return drawn(self._own, *shape)

    def critic_target(self, batch: Batch, noise: Tensor) -> Tensor:
        """As of `SAC`, but for the value: the least of some critics, drawn anew."""
        settings = self.settings
        with torch.no_grad():
            action, density = self.actor.sample(batch.next_observation, noise)
            values = self.targets(batch.next_observation, action)
            shares = drawn(self._own, settings.critics, normal=False)
            value = least(values, shares, settings.least_of)
            if settings.backup_entropy:
                value = value - self.alpha[:, None] * density
            return batch.reward + batch.discount * value

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Learns from a batch and as many demonstrated steps; returns as `SAC.update`."""
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
    replay.discount = learner.replay.discount  # What changes for one does for the other.
    return learner
