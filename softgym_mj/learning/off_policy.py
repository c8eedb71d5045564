"""`OffPolicy`: learns from a replay of all that was done, by updates of an algorithm."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.forms import SymmetrizedPolicy
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.networks import any_actions, drawn, generators
from softgym_mj.learning.replay import Batch, Replay
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class OffPolicySettings:
    """How much is learned from what.

    Attributes:
        random_steps: env steps of each seed that are random, before it learns.
        action_hold: env steps for which a random action goes on, on average.
        updates: for each step of all environments.
        batch: env steps of an update, of each seed.
        replay: env steps of each seed that are kept.
        n_step: env steps whose rewards are added up.
        symmetric: whether replays show the symmetries of the task.
        symmetrize_policy: whether best actions are means over them.
        discount: of rewards, in each env step.
        final_discount: what that rises to; None if it stays.
        discount_schedule: env steps of each seed between which it does, so that its horizon,
            1 / (1 - discount), grows by equal factors.

    Raises:
        InvalidArgumentError: for numbers out of range.
    """

    random_steps: int = 1_000
    action_hold: int = 1
    updates: int = 64
    batch: int = 128
    replay: int = 100_000
    n_step: int = 1
    symmetric: bool = False
    symmetrize_policy: bool = False
    discount: float = 0.99
    final_discount: float | None = None
    discount_schedule: tuple[int, int] = (0, 1)

    def __post_init__(self):
        for name in ("action_hold", "updates", "batch", "replay", "n_step"):
            check_count(name, getattr(self, name), 1)
        check_count("random_steps", self.random_steps, 0)
        if self.final_discount is not None and not self.discount <= self.final_discount < 1.0:
            valid = f"{self.discount} to below 1"
            raise InvalidArgumentError("final_discount", self.final_discount, valid)
        if not 0 <= self.discount_schedule[0] < self.discount_schedule[1]:
            raise InvalidArgumentError(
                "discount_schedule", self.discount_schedule, "from one number to a larger one"
            )
        if self.symmetrize_policy and not self.symmetric:
            raise InvalidArgumentError("symmetrize_policy", True, "False, where symmetric is")

    def discount_at(self, env_steps: int) -> float:
        """The discount after so many env steps of each seed."""
        if self.final_discount is None:
            return self.discount
        first, last = self.discount_schedule
        share = min(max((env_steps - first) / (last - first), 0.0), 1.0)
        return 1.0 - (1.0 - self.discount) ** (1.0 - share) * (1.0 - self.final_discount) ** share


class Algorithm(Protocol):
    """Networks of several seeds and how they are updated.

    Attributes:
        updates: how many there were.
        sources: of the random numbers of updates.
        period: after how many updates all that is done in some of them has been done.
    """

    updates: int
    sources: list[torch.Generator]
    period: int

    def act(self, observation: Tensor, *, explore: bool) -> Tensor:
        """Actions (seeds, n, action) for observations (seeds, n, ...)."""

    def begin(self, sample: Callable[[int], Batch]) -> None:
        """Is told before the first update what draws a batch of so many env steps."""

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Learns from a batch; returns losses (seeds,) by name."""

    def policy(self, seed: int) -> nn.Module:
        """As of `Learner`."""

    def get_state(self) -> dict[str, Any]:
        """As of `Learner`."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """As of `Learner`."""


class OffPolicy:
    """A `Learner`.

    Attributes:
        algorithm: what is updated.
        replay: what it learns from.
    """

    def __init__(
        self,
        settings: OffPolicySettings,
        problem: Problem,
        algorithm: Algorithm,
        replay: Callable[..., Replay] = Replay,
    ):
        """Makes room for the replay.

        Args:
            settings: how much is learned from what.
            problem: what is to be learned.
            algorithm: what is updated.
            replay: makes one of the arguments of `Replay`.
        """
        self._settings, self._problem, self.algorithm = settings, problem, algorithm
        self._symmetries = symmetries(problem.example()) if settings.symmetric else ()
        self._best: Callable[[Tensor], Tensor] = functools.partial(algorithm.act, explore=False)
        if settings.symmetrize_policy:
            if problem.observed not in ("reduced", "markov"):
                valid = "'reduced' or 'markov', to be averaged"
                raise InvalidArgumentError("observation", problem.observed, valid)
            self._best = SymmetrizedPolicy(self._best, self._symmetries, problem.device)
        self.replay = replay(
            settings.replay // problem.num_envs, problem.seeds, problem.num_envs,
            problem.observation,
            problem.action, discount=settings.discount, steps=settings.n_step,
            symmetries=self._symmetries, device=problem.device,
        )  # fmt: skip
        self._noise = generators(problem.seeds, problem.device)
        if settings.updates % algorithm.period:
            valid = f"{algorithm.period} times a number: some updates differ from others"
            raise InvalidArgumentError("updates", settings.updates, valid)
        self._few = CudaGraph(self._update, [*self.replay.sources, *algorithm.sources])
        self._seen = 0  # Env steps of each seed.

    @property
    def updates(self) -> int:
        """How many there were."""
        return self.algorithm.updates

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """See `Learner`."""
        if not explore:
            return self._best(observation), None
        if self._seen < self._settings.random_steps:
            action = self._random(first, memory)
            return action, action
        return self.algorithm.act(observation, explore=True), None

    def _random(self, first: Tensor, before: Tensor | None) -> Tensor:
        """Actions (seeds, n, action), some of which are those of the env step before."""
        number, lasting = first.shape[1], self._settings.action_hold
        fresh = any_actions(self._noise, number, self._problem.action)
        if lasting == 1 or before is None:
            return fresh
        ends = drawn(self._noise, number, normal=False) * lasting < 1.0
        return torch.where((first | ends)[..., None], fresh, before)

    def learn(self, step: Step) -> dict[str, Tensor]:
        """See `Learner`."""
        self.replay.add(step)
        learns = self._seen >= self._settings.random_steps
        self._seen += self._problem.num_envs
        result: dict[str, Tensor] = {}
        if learns and self.replay.size >= self._settings.n_step:
            if not self.updates:
                self.algorithm.begin(self.replay.sample)
            if self._settings.final_discount is not None:
                self.replay.discount.fill_(self._settings.discount_at(self._seen))
            total = self.updates + self._settings.updates
            for _ in range(self._settings.updates // self.algorithm.period):
                result = self._few()
            self.algorithm.updates = total  # A graph does not count.
        return result

    def _update(self) -> dict[str, Tensor]:
        """A period of updates."""
        result: dict[str, Tensor] = {}
        for _ in range(self.algorithm.period):
            result |= self.algorithm.update(self.replay.sample(self._settings.batch))
        return result

    def policy(self, seed: int) -> nn.Module:
        """See `Learner`."""
        policy = self.algorithm.policy(seed)
        return (
            SymmetrizedPolicy(policy, self._symmetries, "cpu")
            if self._settings.symmetrize_policy
            else policy
        )

    def get_state(self) -> dict[str, Any]:
        """See `Learner`."""
        return {
            "algorithm": self.algorithm.get_state(),
            "replay": self.replay.get_state(),
            "noise": [source.get_state() for source in self._noise],
            "seen": self._seen,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """See `Learner`."""
        self.algorithm.set_state(state["algorithm"])
        self.replay.set_state(state["replay"])
        for source, saved in zip(self._noise, state["noise"], strict=True):
            source.set_state(saved)
        self._seen = state["seen"]
