"""Soft actor-critic with hindsight experience replay (HER; Andrychowicz et al., 2017).

A share of each batch is relabeled with a goal that was reached later in the same episode (the
paper's strategy "future"), and with the task's reward for that goal. It supports tasks whose goal
varies (`tasks.shared.goals`). The environments' observation is full; networks observe the reduced
state, which is computed from it.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_number
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import SAC, StateSACSettings
from softgym_mj.learning.networks import drawn, where
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.replay import Batch, Replay
from softgym_mj.tasks.shared import observations
from softgym_mj.tasks.shared.goals import Goals, goals
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class HindsightSettings(StateSACSettings):
    """Settings of soft actor-critic with hindsight.

    Attributes:
        share: Share of a batch that is relabeled; 0.8 is the paper's best.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    share: float = 0.8

    def __post_init__(self):
        super().__post_init__()
        check_number("share", self.share, ge=0.0, le=1.0)


class HindsightReplay(Replay):
    """Replay buffer of full states, whose batches are relabeled reduced states."""

    def __init__(
        self,
        *args: Any,
        of: Goals,
        horizon: int,
        reward_scale: float,
        share: float,
        **settings: Any,
    ):
        """Allocates the buffer.

        Args:
            *args: Arguments of `Replay`.
            of: Goals of the task.
            horizon: Maximum number of env steps in an episode.
            reward_scale: Factor of the task's rewards.
            share: Share of a batch that is relabeled.
            **settings: Further arguments of `Replay`.
        """
        super().__init__(*args, **settings)
        self._goals, self._horizon, self._reward_scale = of, horizon, reward_scale
        self._share = share

    def _added_up(self, first: Tensor, env_index: Tensor) -> Batch:
        batch = super()._added_up(first, env_index)
        share, later = drawn(self.sources, 2, first.shape[1], normal=False).unbind(1)
        left = self._left(first, env_index)
        ahead = torch.minimum((later * (left + 1)).long(), left)
        at = self._from(first, env_index, ahead[..., None])
        reached = self._goals.reached(
            *self._goals.read(self.arrays["next_observation"][at][:, :, 0])
        )
        own = self._goals.read(batch.observation)[1].goal
        goal = {name: where(share < self._share, reached[name], own[name]) for name in own}
        return Batch(
            reduced(self._goals, batch.observation, goal),
            batch.action,
            self._rewards(first, env_index, goal),
            reduced(self._goals, batch.next_observation, goal),
            batch.discount,
        )

    def _from(
        self, first: Tensor, env_index: Tensor, ahead: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Returns indices (vector step, seed, environment) of the steps (seeds, n, k) ahead."""
        seed = torch.arange(self._seeds, device=first.device)[:, None, None]
        return (first[..., None] + ahead) % self._capacity, seed, env_index[..., None]

    def _left(self, first: Tensor, env_index: Tensor) -> Tensor:
        """Returns the number of later steps (seeds, n) of the same episode in the buffer."""
        size, oldest = self._extent
        age = (first - oldest) % self._capacity
        ahead = torch.arange(self._horizon, device=first.device)
        ended = self.arrays["ended"][self._from(first, env_index, ahead)]
        last = ended | (age[..., None] + ahead >= size - 1)
        return (last.cumsum(-1) == 0).sum(-1).clamp(max=self._horizon - 1)

    def _rewards(self, first: Tensor, env_index: Tensor, goal: dict[str, Tensor]) -> Tensor:
        """Returns n-step sums of rewards (seeds, n) from these vector steps, for these goals."""
        ahead = torch.arange(self._steps, device=first.device)
        at = self._from(first, env_index, ahead)
        state, episode = self._goals.read(self.arrays["next_observation"][at])
        same = {name: array[:, :, None] for name, array in goal.items()}
        measures = self._goals.task.measure(state, dataclasses.replace(episode, goal=same))
        ended = self.arrays["ended"][at].long()
        factors = self.discount**ahead * (ended.cumsum(-1) - ended == 0)
        return (factors * self._reward_scale * measures.reward).sum(-1).float()


def reduced(of: Goals, full: Tensor, goal: dict[str, Tensor] | None = None) -> Tensor:
    """Converts full states (..., n) to reduced ones (..., k), optionally with other goals."""
    state, episode = of.read(full)
    if goal is not None:
        episode = dataclasses.replace(episode, goal=goal)
    return observations.reduced(of.task, state, episode).float()


class HindsightSAC(SAC):
    """Soft actor-critic on reduced states that acts on full states."""

    def __init__(
        self,
        settings: HindsightSettings,
        seeds: Sequence[int],
        of: Goals,
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks for the goals of a task; other arguments are those of `SAC`."""
        super().__init__(settings, seeds, of.task.observe("reduced").size, action, device)
        self._goals = of

    def act(self, observation: Tensor, *, explore: bool) -> Tensor:
        """Returns actions (seeds, n, action) for full states (seeds, n, observation)."""
        return super().act(reduced(self._goals, observation), explore=explore)

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""
        return nn.Sequential(_Reduced(self._goals), super().policy(seed))


class _Reduced(nn.Module):
    """Converts full states (n, k) to reduced ones, on the CPU."""

    def __init__(self, of: Goals):
        super().__init__()
        self._goals = of
        self(torch.zeros(1, of.task.observe("full").size))  # Makes the constants of measures.

    def forward(self, full: Tensor) -> Tensor:
        return reduced(self._goals, full)


def make(settings: HindsightSettings, problem: Problem) -> OffPolicy:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: if the task draws no goals, or the observation is not `full`.
    """
    env = problem.example()
    of = goals(env.name, env.task)
    if problem.observation != env.task.observe("full").shape:
        raise InvalidArgumentError("observation", problem.observation, "'full'")
    sac = HindsightSAC(settings, problem.seeds, of, problem.action, problem.device)
    replay = functools.partial(
        HindsightReplay, of=of, horizon=env.horizon, reward_scale=problem.reward_scale,
        share=settings.share,
    )  # fmt: skip
    return OffPolicy(settings, problem, sac, replay)
