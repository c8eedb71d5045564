"""Soft actor-critic (Haarnoja et al., 2018), for several seeds.

Details are the paper's (softagent's `curl_sac.py`): the critic loss is the sum over both critics,
and targets bootstrap at the horizon. The parameter of the entropy weight is log alpha, and its loss
is linear in alpha.
"""

import copy
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.networks import Actor, Critics, DeterministicPolicy, drawn, generators
from softgym_mj.learning.off_policy import OffPolicy, OffPolicySettings
from softgym_mj.learning.optimization import adam, polyak_update, step
from softgym_mj.learning.replay import Batch
from softgym_mj.validation import typed

MOST_ENTROPY = math.log(2.0)  # Entropy of a uniform entry in -1..1 [nats].


@typed
@dataclasses.dataclass(frozen=True)
class SACSettings(OffPolicySettings):
    """Settings of soft actor-critic; the defaults are the paper's for most tasks.

    Attributes:
        hidden: Sizes of the hidden layers of all networks.
        norm: Whether critics have LayerNorm.
        tau: Polyak coefficient of target critics.
        actor_rate: Adam's learning rate of the actor.
        critic_rate: Adam's learning rate of the critics.
        alpha_rate: Adam's learning rate of the logarithm of the entropy weight.
        alpha: Initial entropy weight.
        alpha_beta: Adam's beta_1 of the entropy weight.
        target_entropy: Target entropy of each entry of an action [nats].
        actor_every: Critic updates per update of actor and entropy weight.
        target_every: Critic updates per update of target critics.
        lr_halving_period: Updates after which the rates of actor and critics are halved; 0: never.
        log_std: Bounds of the log standard deviation.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    hidden: tuple[int, ...] = (1024, 1024)
    norm: bool = False
    tau: float = 0.01
    actor_rate: float = 1e-3
    critic_rate: float = 1e-3
    alpha_rate: float = 1e-3
    alpha: float = 0.1
    alpha_beta: float = 0.5
    target_entropy: float = -1.0
    actor_every: int = 2
    target_every: int = 2
    lr_halving_period: int = 0
    log_std: tuple[float, float] = (-10.0, 2.0)

    def __post_init__(self):
        super().__post_init__()
        for name in ("tau", "alpha", "actor_rate", "critic_rate", "alpha_rate"):
            check_number(name, getattr(self, name), gt=0.0, le=1.0)
        for name in ("actor_every", "target_every"):
            check_count(name, getattr(self, name), 1)
        check_count("lr_halving_period", self.lr_halving_period, 0)
        if not self.log_std[0] < self.log_std[1]:
            raise InvalidArgumentError("log_std", self.log_std, "the lower bound, then the upper")
        if not self.target_entropy < MOST_ENTROPY:
            valid = f"below {MOST_ENTROPY:.3f}, that of uniform actions"
            raise InvalidArgumentError("target_entropy", self.target_entropy, valid)


@typed
@dataclasses.dataclass(frozen=True)
class StateSACSettings(SACSettings):
    """Settings of soft actor-critic on states.

    Attributes:
        fused: Whether, on a GPU, losses are compiled to fused kernels (`torch.compile`, which takes
            about a minute at first).
    """

    fused: bool = False


class SAC:
    """Soft actor-critic of several seeds, an `Algorithm` of `OffPolicy`.

    Attributes:
        settings: Settings of the method.
        actor, critics, targets: The networks.
        updates, sources, period: Attributes of `Algorithm`.
    """

    def __init__(
        self,
        settings: SACSettings,
        seeds: Sequence[int],
        observation: int,
        action: int,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks.

        Args:
            settings: Settings of the method.
            seeds: Seeds of the trainings.
            observation, action: Sizes of an observation and an action.
            device: PyTorch device.
        """
        self.settings, self.sources = settings, generators(seeds, device)
        self.actor, self.critics = self._networks(observation, action)
        self.targets = copy.deepcopy(self.critics).requires_grad_(False)
        start = torch.full((len(seeds),), settings.alpha, device=device).log()
        self.log_alpha = start.requires_grad_(True)
        rates: tuple[float | Tensor, ...] = settings.actor_rate, settings.critic_rate
        if settings.lr_halving_period:  # The rates are tensors on the device.
            rates = tuple(torch.tensor(rate, device=device) for rate in rates)
        self._done = torch.zeros((), dtype=torch.int64, device=device)  # Number of updates.
        self._actor_adam = adam(self.actor.parameters(), rates[0])
        self._critic_adam = adam(self.critics.parameters(), rates[1])
        self._alpha_adam = adam([self.log_alpha], settings.alpha_rate, settings.alpha_beta)
        self.updates, self.period = 0, math.lcm(settings.actor_every, settings.target_every)
        self._critic_loss, self._actor_losses = self.critic_loss, self.actor_losses

    def _networks(self, observation: int, action: int) -> tuple[Actor, nn.Module]:
        """Returns new actor and critics."""
        settings, sizes = self.settings, (observation, action, self.settings.hidden)
        return (
            Actor(self.sources, *sizes, settings.log_std),
            Critics(self.sources, *sizes, norm=settings.norm),
        )

    def fuse(self) -> None:
        """Compiles the losses to fused kernels."""
        self._critic_loss = torch.compile(self.critic_loss, dynamic=False)
        self._actor_losses = torch.compile(self.actor_losses, dynamic=False)

    @property
    def alpha(self) -> Tensor:
        """Weights (seeds,) of the entropy."""
        return self.log_alpha.detach().exp()

    def act(self, observation: Any, *, explore: bool) -> Tensor:
        """Returns actions (seeds, n, action) for observations (seeds, n, ...)."""
        with torch.no_grad():
            mean, log_std = self.actor(observation)
            noise = self._noise(*mean.shape[1:]) * log_std.exp() if explore else 0.0
            return torch.tanh(mean + noise)

    def _noise(self, *shape: int) -> Tensor:
        return drawn(self.sources, *shape)

    # ------------------------------------------------------------------ losses

    def _reduce_critics(self, values: Tensor) -> Tensor:
        """Combines the critics' values (critics, seeds, n) to one (seeds, n): their minimum."""
        return values.amin(0)

    def critic_target(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns critic targets (seeds, n); arguments are those of `critic_loss`."""
        with torch.no_grad():
            action, density = self.actor.sample(batch.next_observation, noise)
            value = self._reduce_critics(self.targets(batch.next_observation, action))
            value = value - self.alpha[:, None] * density
            return batch.reward + batch.discount * value

    def critic_loss(self, batch: Batch, noise: Tensor) -> Tensor:
        """Returns the sum (seeds,) of both critics' mean squared errors.

        Args:
            batch: The batch.
            noise: Standard normal noise of next actions (seeds, n, action).
        """
        result = self.critics(batch.observation, batch.action)
        return ((result - self.critic_target(batch, noise)) ** 2).mean(-1).sum(0)

    def actor_losses(self, batch: Batch, noise: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the losses (seeds,) of the actor and of the entropy weight.

        Args:
            batch: The batch.
            noise: Standard normal noise of actions (seeds, n, action).
        """
        action, density = self.actor.sample(batch.observation, noise)
        value = self._reduce_critics(self.critics(batch.observation, action))
        actor = (self.alpha[:, None] * density - value).mean(-1)
        target = self.settings.target_entropy * action.shape[-1]
        surplus = (-density - target).detach().mean(-1)
        return actor, self.log_alpha.exp() * surplus

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Makes one update from a batch; returns losses and entropy weights (seeds,) by name."""
        size = batch.action.shape[1:]
        if self.settings.lr_halving_period:
            self._set_learning_rates()
        loss = self._critic_loss(batch, self._noise(*size))
        step(self._critic_adam, loss)
        result = {"critic_loss": loss.detach(), "alpha": self.alpha}
        self.updates += 1
        if self.updates % self.settings.actor_every == 0:
            self.critics.requires_grad_(False)
            actor, alpha = self._actor_losses(batch, self._noise(*size))
            self._alpha_adam.zero_grad(set_to_none=True)
            step(self._actor_adam, actor + alpha)  # The losses share no weights.
            self._alpha_adam.step()
            self.critics.requires_grad_(True)
            result["actor_loss"] = actor.detach()
        if self.updates % self.settings.target_every == 0:
            self._update_targets()
        return result

    def _set_learning_rates(self) -> None:
        """Sets the learning rates of this update."""
        share = torch.exp2(-(self._done // self.settings.lr_halving_period).float())
        self._actor_adam.param_groups[0]["lr"].copy_(self.settings.actor_rate * share)
        self._critic_adam.param_groups[0]["lr"].copy_(self.settings.critic_rate * share)
        self._done += 1

    def _update_targets(self) -> None:
        """Updates the target critics."""
        polyak_update(self.targets, self.critics, self.settings.tau)

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""
        return DeterministicPolicy(self.actor, seed)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""
        state = {
            "actor": self.actor.state_dict(),
            "critics": self.critics.state_dict(),
            "targets": self.targets.state_dict(),
            "log_alpha": self.log_alpha.detach(),
            "adam": [optimizer.state_dict() for optimizer in self._adams],
            "random": [source.get_state() for source in self.sources],
            "updates": self.updates,
        }
        return copy.deepcopy(state)  # Training changes the arrays in place.

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        for name in ("actor", "critics", "targets"):
            getattr(self, name).load_state_dict(state[name])
        with torch.no_grad():
            self.log_alpha.copy_(state["log_alpha"])
        for optimizer, saved in zip(self._adams, state["adam"], strict=True):
            rate = optimizer.param_groups[0]["lr"]  # CUDA graphs need the same tensor.
            optimizer.load_state_dict(copy.deepcopy(saved))
            optimizer.param_groups[0]["lr"] = rate
        for source, saved in zip(self.sources, state["random"], strict=True):
            source.set_state(saved)
        self.updates = state["updates"]
        self._done.fill_(self.updates)

    @property
    def _adams(self) -> tuple[torch.optim.Adam, ...]:
        return self._actor_adam, self._critic_adam, self._alpha_adam


def make(settings: StateSACSettings, problem: Problem, kind: type[SAC] = SAC) -> OffPolicy:
    """Returns the `Learner` of a problem, with an algorithm of a kind."""
    (size,) = problem.observation
    algorithm = kind(settings, problem.seeds, size, problem.action, problem.device)
    if settings.fused and torch.device(problem.device).type == "cuda":
        algorithm.fuse()
    return OffPolicy(settings, problem, algorithm)
