"""`OffPolicy`: off-policy learner with a replay buffer and an algorithm that is updated from it."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.networks import any_actions, drawn, generators
from softgym_mj.learning.replay import Batch, Replay
from softgym_mj.learning.signed_orders import SymmetrizedPolicy
from softgym_mj.learning.symmetries import Symmetry, check_observed, symmetries
from softgym_mj.tasks.shared.observations import names_of
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class OffPolicySettings:
    """Settings of off-policy learning; numbers of env steps are per seed.

    Attributes:
        random_steps: Env steps with random actions before learning starts.
        action_hold: Mean number of env steps that a random action is repeated.
        updates: Updates per vector step.
        batch: Env steps in an update.
        replay: Capacity of the replay buffer in env steps.
        n_step: Number of steps in n-step returns.
        symmetric: Whether sampled steps are transformed by random symmetries of the task.
        symmetrize_policy: Whether deterministic actions are averaged over the task's symmetries.
        discount: Discount per env step.
        final_discount: Final discount; None for a constant one.
        discount_schedule: First and last env step of the change from `discount` to
            `final_discount`, in which 1 / (1 - discount) grows exponentially.

    Raises:
        InvalidArgumentError: for a value out of range.
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
        check_number("discount", self.discount, gt=0.0, le=1.0)
        if self.final_discount is not None and not self.discount <= self.final_discount < 1.0:
            valid = f"at least discount={self.discount} and below 1"
            raise InvalidArgumentError("final_discount", self.final_discount, valid)
        if not 0 <= self.discount_schedule[0] < self.discount_schedule[1]:
            raise InvalidArgumentError(
                "discount_schedule", self.discount_schedule, "two increasing numbers, 0 or more"
            )
        if self.symmetrize_policy and not self.symmetric:
            raise InvalidArgumentError("symmetrize_policy", True, "False with symmetric=False")

    def discount_at(self, env_steps: int) -> float:
        """Returns the discount after `env_steps` env steps."""
        if self.final_discount is None:
            return self.discount
        first, last = self.discount_schedule
        share = min(max((env_steps - first) / (last - first), 0.0), 1.0)
        return 1.0 - (1.0 - self.discount) ** (1.0 - share) * (1.0 - self.final_discount) ** share


class Algorithm(Protocol):
    """Protocol of algorithms: networks of several seeds and their updates.

    Attributes:
        updates: Number of updates so far.
        sources: Random generators of updates.
        period: Number of updates after which their schedule (actor, targets) repeats.
    """

    updates: int
    sources: list[torch.Generator]
    period: int

    def act(self, observation: Tensor, *, explore: bool) -> Tensor:
        """Returns actions (seeds, n, action) for observations (seeds, n, ...)."""

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Makes one update from a batch; returns losses (seeds,) by name."""

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""


class OffPolicy:
    """Off-policy learner: collects steps in a replay buffer and updates an algorithm from it.

    Attributes:
        algorithm: The algorithm.
        replay: The replay buffer.
    """

    def __init__(self, settings: OffPolicySettings, problem: Problem, algorithm: Algorithm):
        """Allocates the replay buffer.

        Args:
            settings: Settings of off-policy learning.
            problem: Learning problem.
            algorithm: The algorithm.
        """
        self._settings, self._problem, self.algorithm = settings, problem, algorithm
        self._symmetries: Sequence[Symmetry] = ()
        if settings.symmetric:
            check_observed(problem.observed)
            self._symmetries = symmetries(problem.example(), *names_of(problem.observed))
        self._best: Callable[[Tensor], Tensor] = functools.partial(algorithm.act, explore=False)
        if settings.symmetrize_policy:
            self._best = SymmetrizedPolicy(self._best, self._symmetries, problem.device)
        self.replay = Replay(
            settings.replay // problem.num_envs, problem.seeds, problem.num_envs,
            problem.observation,
            problem.action, discount=settings.discount, steps=settings.n_step,
            symmetries=self._symmetries, device=problem.device,
        )  # fmt: skip
        self._noise = generators(problem.seeds, problem.device)
        if settings.updates % algorithm.period:
            names = (name for name in ("actor_every", "target_every") if hasattr(settings, name))
            every = ", ".join(f"{name}={getattr(settings, name)}" for name in names)
            valid = f"a multiple of {algorithm.period}" + f" ({every})" * bool(every)
            raise InvalidArgumentError("updates", settings.updates, valid)
        self._run_period = CudaGraph(self._update, [*self.replay.sources, *algorithm.sources])
        self._env_steps = 0  # Env steps of each seed so far.

    @property
    def updates(self) -> int:
        """Number of updates so far."""
        return self.algorithm.updates

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions and memory, as `Learner.act` does."""
        if not explore:
            return self._best(observation), None
        if self._env_steps < self._settings.random_steps:
            action = self._random(first, memory)
            return action, action
        return self.algorithm.act(observation, explore=True), None

    def _random(self, first: Tensor, before: Tensor | None) -> Tensor:
        """Returns random actions (seeds, n, action), some repeated from the env step before."""
        number, hold = first.shape[1], self._settings.action_hold
        fresh = any_actions(self._noise, number, self._problem.action)
        if hold == 1 or before is None:
            return fresh
        ends = drawn(self._noise, number, normal=False) * hold < 1.0
        return torch.where((first | ends)[..., None], fresh, before)

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Adds a vector step and updates the networks; returns losses (seeds,) by name."""
        self.replay.add(step)
        learns = self._env_steps >= self._settings.random_steps
        self._env_steps += self._problem.num_envs
        result: dict[str, Tensor] = {}
        if learns and self.replay.size >= self._settings.n_step:
            if self._settings.final_discount is not None:
                self.replay.discount.fill_(self._settings.discount_at(self._env_steps))
            total = self.updates + self._settings.updates
            for _ in range(self._settings.updates // self.algorithm.period):
                result = self._run_period()
            self.algorithm.updates = total  # A CUDA graph does not run Python code.
        return result

    def _update(self) -> dict[str, Tensor]:
        """Makes a period of updates; returns the last losses."""
        result: dict[str, Tensor] = {}
        for _ in range(self.algorithm.period):
            result |= self.algorithm.update(self.replay.sample(self._settings.batch))
        return result

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""
        policy = self.algorithm.policy(seed)
        return (
            SymmetrizedPolicy(policy, self._symmetries, "cpu")
            if self._settings.symmetrize_policy
            else policy
        )

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""
        return {
            "algorithm": self.algorithm.get_state(),
            "replay": self.replay.get_state(),
            "noise": [source.get_state() for source in self._noise],
            "seen": self._env_steps,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.algorithm.set_state(state["algorithm"])
        self.replay.set_state(state["replay"])
        for source, saved in zip(self._noise, state["noise"], strict=True):
            source.set_state(saved)
        self._env_steps = state["seen"]
