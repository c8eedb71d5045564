"""Proximal policy optimization (Schulman et al., 2017), for several seeds.

Settings and networks are those of ManiSkill's baseline for a thousand environments
(`examples/baselines/ppo/ppo.py`), which is based on CleanRL. Losses are implemented here because
torchrl's `ClipPPOLoss`, the tests' oracle, averages over seeds. There are two differences. Returns
bootstrap at the horizon; only divergence ends them. A seed stops before the minibatch whose policy
diverges too far, as in Stable-Baselines3, instead of after its epoch.
"""

import copy
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.ppo.rollout import Rollout, advantages
from softgym_mj.learning.methods.ppo.stopping import StoppingAdam
from softgym_mj.learning.networks import MLP, drawn, generators
from softgym_mj.learning.replay import Replay
from softgym_mj.validation import typed

_LAST_GAIN = 0.01 * math.sqrt(2.0)  # Initial gain of the last layer, for small actions.
_LOG_STD = -0.5  # Initial log standard deviation.


@typed
@dataclasses.dataclass(frozen=True)
class PPOSettings:
    """Settings of PPO.

    Attributes:
        steps: Vector steps of a rollout.
        epochs: Epochs per rollout.
        minibatches: Minibatches per epoch.
        hidden: Sizes of the hidden layers of both networks.
        rate: Learning rate of Adam.
        discount: Discount per env step.
        trace: Lambda of generalized advantage estimation.
        clip: Clipping range of the probability ratio.
        value_weight, entropy_weight: Weights of the value loss and of the entropy.
        largest_gradient: Maximum gradient norm.
        target_divergence: KL divergence from the rollout's policy at which a seed stops.

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    steps: int = 16
    epochs: int = 8
    minibatches: int = 32
    hidden: tuple[int, ...] = (256, 256, 256)
    rate: float = 3e-4
    discount: float = 0.97
    trace: float = 0.95
    clip: float = 0.2
    value_weight: float = 0.5
    entropy_weight: float = 0.0
    largest_gradient: float = 0.5
    target_divergence: float = 0.1

    def __post_init__(self):
        for name in ("steps", "epochs", "minibatches"):
            check_count(name, getattr(self, name), 1)
        for name in ("rate", "discount", "trace", "clip"):
            check_number(name, getattr(self, name), gt=0.0, le=1.0)
        for name in ("value_weight", "entropy_weight"):
            check_number(name, getattr(self, name), ge=0.0)
        for name in ("largest_gradient", "target_divergence"):
            check_number(name, getattr(self, name), gt=0.0)


class Gaussian(nn.Module):
    """Gaussian policy with a state-independent standard deviation."""

    def __init__(
        self,
        sources: Sequence[torch.Generator],
        observation: int,
        action: int,
        hidden: Sequence[int],
    ):
        super().__init__()
        self.body = _network(sources, [observation, *hidden, action])
        with torch.no_grad():
            self.body[-1].weight.mul_(_LAST_GAIN)
        start = torch.full((len(sources), 1, action), _LOG_STD, device=sources[0].device)
        self.log_std = nn.Parameter(start)

    def forward(self, observation: Tensor) -> Tensor:
        """Returns mean actions (seeds, n, action) for observations (seeds, n, observation)."""
        return self.body(observation)

    def log_density(self, observation: Tensor, action: Tensor) -> Tensor:
        """Returns log densities (seeds, n) of actions (seeds, n, action)."""
        far = (action - self(observation)) / self.log_std.exp()
        return -(0.5 * far**2 + self.log_std + 0.5 * math.log(2.0 * math.pi)).sum(-1)

    def entropy(self) -> Tensor:
        """Returns the entropy (seeds,)."""
        return (self.log_std + 0.5 * math.log(2.0 * math.pi * math.e)).sum((1, 2))


def _network(sources: Sequence[torch.Generator], sizes: Sequence[int]) -> MLP:
    """Returns a multilayer perceptron with tanh."""
    result = MLP(sources, sizes)
    for k, layer in enumerate(result):
        if isinstance(layer, nn.ReLU):
            result[k] = nn.Tanh()
    return result


class PPO:
    """PPO `Learner`.

    Attributes:
        settings: Settings of PPO.
        policies, values: The networks.
        updates: Number of minibatches, including those after a seed has stopped.
    """

    def __init__(self, settings: PPOSettings, problem: Problem):
        """Draws the networks and allocates a rollout.

        Raises:
            InvalidArgumentError: if the rollout is not a multiple of the minibatches.
        """
        total = settings.steps * problem.num_envs
        if total % settings.minibatches or total == settings.minibatches:
            valid = f"a part of {total}, the env steps of a rollout, and fewer"
            raise InvalidArgumentError("minibatches", settings.minibatches, valid)
        (size,) = problem.observation
        self.settings, self.updates, self._seen = settings, 0, 0
        self._sources = generators(problem.seeds, problem.device)
        self.policies = Gaussian(self._sources, size, problem.action, settings.hidden)
        self.values = _network(self._sources, [size, *settings.hidden, 1])
        weights = [*self.policies.parameters(), *self.values.parameters()]
        self._adam = StoppingAdam(weights, settings.rate, settings.largest_gradient)
        self._steps = Replay(
            settings.steps, problem.seeds, problem.num_envs, problem.observation, problem.action,
            discount=settings.discount, device=problem.device,
        )  # fmt: skip
        lead = len(problem.seeds), total
        self._going = torch.ones(lead[0], dtype=torch.bool, device=problem.device)
        self._drawn = torch.zeros(0)  # Last unclipped actions of `act`.
        # Allocated once: the CUDA graph of an epoch reads fixed addresses.
        self._rollout = Rollout(
            *(torch.zeros(*lead, n, device=problem.device) for n in (size, problem.action)),
            *(torch.zeros(lead, device=problem.device) for _ in range(3)),
        )
        self._epoch = CudaGraph(self._learn_all, self._sources)

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns clipped actions; `learn` uses the unclipped ones."""
        with torch.no_grad():
            action = self.policies(observation)
            if explore:
                noise = drawn(self._sources, *action.shape[1:])
                action = action + noise * self.policies.log_std.exp()
                self._drawn = action
            return action.clamp(-1.0, 1.0), None

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Adds a vector step of the last actions of `act`; updates after a full rollout."""
        self._steps.add(step._replace(action=self._drawn))
        self._seen += 1
        if self._seen % self.settings.steps:
            return {}
        self._prepare()
        for _ in range(self.settings.epochs):
            result = self._epoch()
        self.updates += self.settings.epochs * self.settings.minibatches
        return {**result, "going": self._going.float()}

    def _prepare(self) -> None:
        """Computes advantages and targets of the rollout with the current networks."""
        steps, settings = self._steps.arrays, self.settings
        self._going.fill_(True)
        with torch.no_grad():
            value, next_value = (
                torch.stack([self.values(seen)[..., 0] for seen in steps[name]])
                for name in ("observation", "next_observation")
            )
            advantage = advantages(
                steps["reward"], value, next_value, steps["terminated"], steps["ended"],
                discount=settings.discount, trace=settings.trace,
            )  # fmt: skip
            log_density = torch.stack(
                [
                    self.policies.log_density(*each)
                    for each in zip(steps["observation"], steps["action"], strict=True)
                ]
            )
            result = Rollout(
                steps["observation"], steps["action"], log_density, advantage, advantage + value
            )
            for name, array in vars(self._rollout).items():
                array.copy_(getattr(result, name).transpose(0, 1).flatten(1, 2))

    def _learn_all(self) -> dict[str, Tensor]:
        """Runs an epoch; returns the last losses."""
        total = self._rollout.advantage.shape[1]
        order = drawn(self._sources, total, normal=False).argsort(-1)
        seed = torch.arange(len(order), device=order.device)[:, None]
        result: dict[str, Tensor] = {}
        for at in order.chunk(self.settings.minibatches, dim=1):
            part = Rollout(*(array[seed, at] for array in vars(self._rollout).values()))
            loss, result = self.losses(part)
            self._going &= result["divergence"] <= self.settings.target_divergence
            self._adam.step(loss, self._going)
        return result

    def losses(self, part: Rollout) -> tuple[Tensor, dict[str, Tensor]]:
        """Returns the loss (seeds,), and its terms and the KL divergence by name.

        The divergence of old and new policy is Schulman's estimate:
        joschu.net/blog/kl-approx.html.
        """
        settings, advantage = self.settings, part.advantage
        deviation = advantage.std(-1, keepdim=True) + 1e-8
        advantage = (advantage - advantage.mean(-1, keepdim=True)) / deviation
        log_ratio = self.policies.log_density(part.observation, part.action) - part.log_density
        ratio = log_ratio.exp()
        clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
        policy = -torch.minimum(ratio * advantage, clipped * advantage).mean(-1)
        value = 0.5 * ((self.values(part.observation)[..., 0] - part.value_target) ** 2).mean(-1)
        entropy = self.policies.entropy()
        loss = policy + settings.value_weight * value - settings.entropy_weight * entropy
        divergence = (ratio - 1.0 - log_ratio).mean(-1)
        result = {"policy_loss": policy, "value_loss": value, "entropy": entropy}
        result["divergence"] = divergence
        return loss, {name: each.detach() for name, each in result.items()}

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""
        return _Mean(self.policies, seed)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""
        state = {
            "policies": self.policies.state_dict(),
            "values": self.values.state_dict(),
            "adam": self._adam.get_state(),
            "steps": self._steps.get_state(),
            "random": [source.get_state() for source in self._sources],
            "seen": self._seen,
            "updates": self.updates,
        }
        return copy.deepcopy(state)  # Training changes the arrays in place.

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.policies.load_state_dict(state["policies"])
        self.values.load_state_dict(state["values"])
        self._adam.set_state(state["adam"])
        self._steps.set_state(state["steps"])
        for source, saved in zip(self._sources, state["random"], strict=True):
            source.set_state(saved)
        self._seen, self.updates = state["seen"], state["updates"]


class _Mean(nn.Module):
    """Deterministic policy of one seed: maps observations (n, k) to mean actions."""

    def __init__(self, policies: Gaussian, seed: int):
        super().__init__()
        self.body = copy.deepcopy(policies.body).cpu()
        for parameter in self.body.parameters():
            parameter.data = parameter.data[seed : seed + 1].clone()
        self.requires_grad_(False)

    def forward(self, observation: Tensor) -> Tensor:
        return self.body(observation[None])[0].clamp(-1.0, 1.0)


make = PPO  # Creates the learner from settings and a problem.
