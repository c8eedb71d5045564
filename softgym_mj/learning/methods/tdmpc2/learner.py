"""TD-MPC2 (Hansen et al., 2024) on state vectors: planning in latent states of a learned model.

Settings and details are those of the published code for a single task; torchrl 0.14.1 has no
implementation. As there, plans ignore the end of an episode.
"""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.tdmpc2 import losses
from softgym_mj.learning.methods.tdmpc2.mppi import mppi
from softgym_mj.learning.methods.tdmpc2.networks import Prior, WorldModel, imagined
from softgym_mj.learning.methods.tdmpc2.settings import TDMPC2Settings
from softgym_mj.learning.networks import DeterministicPolicy, any_actions, drawn, generators
from softgym_mj.learning.optimization import adam, clip_grad_norm, polyak_update
from softgym_mj.learning.replay import Replay

# Published discount: its horizon is a fifth of an episode, within these bounds.
_EPISODE_SHARE, _LEAST_DISCOUNT, _LARGEST_DISCOUNT = 5, 0.95, 0.995
_POLICY_EPSILON = 1e-5  # Epsilon of the policy's Adam (published code).


class TDMPC2:
    """TD-MPC2 `Learner`: world models and policy priors of several seeds.

    Attributes:
        settings: Settings of TD-MPC2.
        model: The networks.
        scale: Running spread of values (seeds,), at least 1.
        replay: The replay buffer.
        updates: Number of updates so far.
    """

    def __init__(
        self,
        settings: TDMPC2Settings,
        seeds: Sequence[int],
        num_envs: int,
        observation: int,
        action: int,
        *,
        discount: float,
        device: torch.device | str = "cpu",
    ):
        """Draws the networks.

        Args:
            settings: Settings of TD-MPC2.
            seeds: Seeds of the trainings.
            num_envs: Number of environments of each seed.
            observation, action: Sizes of an observation and an action.
            discount: Discount per env step.
            device: PyTorch device.
        """
        check_count("replay", settings.replay, settings.horizon * num_envs)
        self.settings, self._seeds, self._num_envs = settings, seeds, num_envs
        self._action, self._discount = action, discount
        # Random generators of updates, exploration and evaluations.
        self._sources, self._noise, self._trials = (generators(seeds, device) for _ in range(3))
        self.model = WorldModel(settings, self._sources, observation, action)
        self.scale = torch.ones(len(seeds), device=device)
        self.replay = Replay(
            settings.replay // num_envs, seeds, num_envs, (observation,), action, discount=discount,
            device=device,
        )  # fmt: skip
        model = self.model
        rest = nn.ModuleList([model.dynamics, model.reward, model.critics])
        self._encoder_adam = adam(model.encoder.parameters(), settings.encoder_rate)
        self._model_adam = adam(rest.parameters(), settings.rate)
        self._policy_adam = adam(model.actor.parameters(), settings.rate, eps=_POLICY_EPSILON)
        self._again = CudaGraph(self._learn_once, [*self.replay.sources, *self._sources])
        self.updates, self._seen = 0, 0  # `_seen`: env steps of each seed.

    # ------------------------------------------------------------------ acting

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions; the memory is the planner's last mean (seeds, n, horizon, action)."""
        number, size = observation.shape[1], self._action
        if explore and self._seen < self.settings.random_steps:
            return any_actions(self._noise, number, size), None
        with torch.no_grad():
            latent = self.model.encode(observation)
            if self.settings.plans == "never" or (explore and self.settings.plans != "always"):
                if not explore:
                    return self.model.actor.mean(latent), None
                return self.model.sample(latent, drawn(self._noise, number, size))[0], None
            if memory is None:
                memory = latent.new_zeros(*latent.shape[:2], self.settings.horizon, size)
                # Every evaluation starts with the same random numbers.
                for seed, source in zip(self._seeds, self._trials, strict=True):
                    source.manual_seed(seed)
            shifted = torch.cat([memory[:, :, 1:], torch.zeros_like(memory[:, :, :1])], dim=2)
            mean = torch.where(first[..., None, None], 0.0, shifted)
            return self._plan(latent, mean, explore=explore)

    def _plan(self, latent: Tensor, mean: Tensor, *, explore: bool) -> tuple[Tensor, Tensor]:
        settings, sources = self.settings, self._noise if explore else self._trials
        shape = latent.shape[1], settings.proposals
        state, proposals = latent[:, :, None].expand(-1, -1, shape[1], -1), list[Tensor]()
        for _ in range(settings.horizon):
            action, _ = self.model.sample(state, drawn(sources, *shape, self._action))
            proposals.append(action)
            state = self.model.following(state, action)

        def value(actions: Tensor) -> Tensor:
            samples = actions.shape[1:3]
            noise = drawn(sources, *samples, self._action)
            states = latent[:, :, None].expand(-1, -1, samples[1], -1)
            pair = self._pairs(sources)
            return imagined(self.model, states, actions, noise, pair, self._discount)

        return mppi(value, torch.stack(proposals, 3), mean, settings, sources, explore=explore)

    def _pairs(self, sources: Sequence[torch.Generator]) -> Tensor:
        """Returns the indices of two different critics of each seed (seeds, 2)."""
        return drawn(sources, self.settings.critics, normal=False).argsort(-1)[:, :2]

    # ------------------------------------------------------------------ learning

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Adds a vector step and updates the networks; returns losses (seeds,) by name."""
        settings = self.settings
        self.replay.add(step)
        learns = self._seen >= settings.random_steps and self.replay.size >= settings.horizon
        self._seen += self._num_envs
        result: dict[str, Tensor] = {}
        if learns:
            number = settings.updates + (0 if self.updates else settings.pretraining)
            for _ in range(number):
                result = self._again()
            self.updates += number
        return result

    def _learn_once(self) -> dict[str, Tensor]:
        return self.update(self.replay.slices(self.settings.batch, self.settings.horizon))

    def update(self, step: Step) -> dict[str, Tensor]:
        """Makes one update from sequences (seeds, n, horizon, ...); returns losses (seeds,)."""
        settings, model = self.settings, self.model
        number, length = step.reward.shape[1:]
        result, latent = losses.model_losses(
            model, step, *self._draws(number, length), discount=self._discount, rho=settings.rho
        )
        weighted = [getattr(settings, name) * loss for name, loss in result.items()]
        self._follow([self._encoder_adam, self._model_adam], sum(weighted[1:], weighted[0]))
        counts = losses.counted(step.ended)
        counts = torch.cat([counts[..., :1], counts], dim=-1)  # A state counts if its step does.
        model.critics.requires_grad_(False)
        values, entropy = losses.policy_values(model, latent, *self._draws(number, length + 1))
        wide = losses.spread(values[:, :, 0].detach())
        self.scale.lerp_(wide.clamp(min=1.0), settings.tau)
        worth = values / self.scale[:, None, None] + settings.entropy * entropy
        loss = -(losses.shares(counts, settings.rho) * worth).sum((1, 2))
        self._follow([self._policy_adam], loss)
        model.critics.requires_grad_(True)
        polyak_update(model.targets, model.critics, settings.tau)
        summary = {f"{name}_loss": value.detach() for name, value in result.items()}
        return {**summary, "policy_loss": loss.detach(), "scale": self.scale.clone()}

    def _draws(self, number: int, length: int) -> tuple[Tensor, Tensor, Tensor]:
        """Returns noise of actions, indices of two critics and dropout masks of an update."""
        noise = drawn(self._sources, number, length, self._action)
        kept_mask = self.model.dropout(self._sources, number * length)
        return noise, self._pairs(self._sources), kept_mask

    def _follow(self, optimizers: Sequence[torch.optim.Adam], loss: Tensor) -> None:
        """Takes an optimization step on the loss (seeds,), with gradient clipping."""
        for optimizer in optimizers:
            optimizer.zero_grad(set_to_none=True)
        loss.sum().backward()
        weights = [w for each in optimizers for group in each.param_groups for w in group["params"]]
        clip_grad_norm(weights, len(self._seeds), self.settings.largest_gradient)
        for optimizer in optimizers:
            optimizer.step()

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy prior of the seed at an index, which acts without planning."""
        if self.settings.plans != "never":
            valid = "'never': a planner remembers its last plan, of which no file can be made"
            raise InvalidArgumentError("plans", self.settings.plans, valid)
        return DeterministicPolicy(Prior(self.model), seed)

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""
        state = {
            "model": self.model.state_dict(),
            "scale": self.scale,
            "adam": [optimizer.state_dict() for optimizer in self._adams],
            "random": [source.get_state() for source in (*self._sources, *self._noise)],
            "updates": self.updates,
            "seen": self._seen,
        }
        return {**copy.deepcopy(state), "replay": self.replay.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.model.load_state_dict(state["model"])
        self.scale.copy_(state["scale"])
        for optimizer, saved in zip(self._adams, state["adam"], strict=True):
            optimizer.load_state_dict(copy.deepcopy(saved))
        for source, saved in zip((*self._sources, *self._noise), state["random"], strict=True):
            source.set_state(saved)
        self.updates, self._seen = state["updates"], state["seen"]
        self.replay.set_state(state["replay"])

    @property
    def _adams(self) -> tuple[torch.optim.Adam, ...]:
        return self._encoder_adam, self._model_adam, self._policy_adam


def discount_of(horizon: int) -> float:
    """Returns TD-MPC2's discount for a number of env steps in an episode."""
    share = horizon / _EPISODE_SHARE
    return min(max((share - 1.0) / share, _LEAST_DISCOUNT), _LARGEST_DISCOUNT)


def make(settings: TDMPC2Settings, problem: Problem) -> TDMPC2:
    """Returns the `Learner` of a problem.

    Raises:
        InvalidArgumentError: for images.
    """
    if len(problem.observation) != 1:
        raise InvalidArgumentError("observation", problem.observation, "numbers (n,), not images")
    return TDMPC2(
        settings, problem.seeds, problem.num_envs, *problem.observation, problem.action,
        discount=discount_of(problem.example().horizon), device=problem.device,
    )  # fmt: skip
