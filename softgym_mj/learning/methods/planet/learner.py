"""PlaNet (Hafner et al., 2019) for several seeds: planning in latents of a world model of images.

Loss weights, noise and planner are those of SoftGym's authors (softagent's `planet/`), with two
differences: actions are clipped before they are stored, as environments clip them, and belief and
latent are reset where a sequence crosses the end of an episode (there: the latent only). torchrl's
`CEMPlanner` clips all candidates, and its `DreamerModelLoss` averages over seeds.
"""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.learner import Problem, Step, UnexportableError
from softgym_mj.learning.methods.planet.latent import WorldModel, centered
from softgym_mj.learning.networks import any_actions, drawn, generators
from softgym_mj.learning.optimization import adam, clip_grad_norm
from softgym_mj.learning.replay import Replay
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class PlaNetSettings:
    """Settings of PlaNet; the defaults are the paper's.

    Attributes:
        random_steps: Env steps of each seed with random actions before learning starts.
        updates: Updates per vector step.
        batch: Sequences of each seed in an update.
        length: Frames in a sequence.
        replay: Capacity of the replay buffer in env steps of each seed.
        bits: Bits of each color channel, at most 8.
        noise: Standard deviation of the noise on training actions.
        evaluation_noise: Standard deviation of the noise on evaluation actions.
        belief, latent, hidden: Sizes of belief, latent and hidden layers.
        channels: Channels of the encoder's last layer.
        free_nats: Minimum of the KL divergence in the loss.
        rate, epsilon: Learning rate and epsilon of Adam.
        gradient_norm: Maximum gradient norm of a seed.
        horizon: Planning horizon in env steps.
        iterations: Number of times that the distribution of plans is fitted.
        candidates, elites: Plans in an iteration, and those that the distribution is fitted to.
        bfloat16: Whether convolutions and plans compute in bfloat16 with 32-bit weights.
        fused: Whether, on a GPU, time steps are compiled to fused kernels (`torch.compile`, which
            takes about a minute at first).

    Raises:
        InvalidArgumentError: for a value out of range.
    """

    random_steps: int = 450
    updates: int = 1
    batch: int = 50
    length: int = 50
    replay: int = 80_000
    bits: int = 5
    noise: float = 0.3
    evaluation_noise: float = 0.3
    belief: int = 200
    latent: int = 30
    hidden: int = 200
    channels: int = 256
    free_nats: float = 3.0
    rate: float = 1e-3
    epsilon: float = 1e-4
    gradient_norm: float = 1000.0
    horizon: int = 24
    iterations: int = 10
    candidates: int = 1000
    elites: int = 100
    bfloat16: bool = False
    fused: bool = False

    def __post_init__(self):
        counts = ("updates", "batch", "belief", "latent", "hidden", "channels")
        for name in (*counts, "horizon", "iterations", "candidates"):
            check_count(name, getattr(self, name), 1)
        check_count("random_steps", self.random_steps, 0)
        check_count("length", self.length, 2)
        check_count("bits", self.bits, 1, 8)
        check_count("elites", self.elites, 1, self.candidates)
        for name in ("rate", "epsilon", "gradient_norm"):
            check_number(name, getattr(self, name), gt=0.0)
        for name in ("noise", "evaluation_noise", "free_nats"):
            check_number(name, getattr(self, name), ge=0.0)


class Memory(NamedTuple):
    """Belief and latent of environments (seeds, n, ...), and random generators of evaluations."""

    sources: list[torch.Generator] | None
    belief: Tensor
    latent: Tensor
    action: Tensor


def losses(
    model: WorldModel, step: Step, image: Tensor, noise: Tensor, free_nats: float
) -> dict[str, Tensor]:
    """Returns the losses (seeds,) by name, whose sum is minimized.

    Args:
        model: The world model.
        step: Sequences (seeds, n, steps, ...).
        image: Images after each step (seeds, n, steps, size, size, 3), in -0.5..0.5.
        noise: Noise of latents (seeds, n, steps, latent).
        free_nats: Setting of `PlaNetSettings`.
    """
    path = model.observe(image, step.action, step.ended, noise)
    belief, latent = path.belief.flatten(1, 2), path.latent.flatten(1, 2)
    error = (model.image(belief, latent) - image.flatten(1, 2)) ** 2
    missed = (model.reward(belief, latent) - step.reward.flatten(1, 2)) ** 2
    divergence = path.posterior.divergence(path.prior).clamp(min=free_nats)
    return {
        "image_loss": error.sum((-3, -2, -1)).mean(1),  # Over pixels, and colors: summed.
        "reward_loss": missed.mean(1),
        "divergence": divergence.mean((1, 2)),
    }


def plan(
    model: WorldModel,
    belief: Tensor,
    latent: Tensor,
    sources: Sequence[torch.Generator],
    settings: PlaNetSettings,
) -> Tensor:
    """Plans by the cross-entropy method; returns the first actions (seeds, n, action), not clipped.

    The initial distribution is standard normal; actions are the means of the last distribution.

    Args:
        model: World model that predicts rewards.
        belief, latent: Initial state (seeds, n, ...).
        sources: Random generators.
        settings: Settings of the planner.
    """
    number, own = belief.shape[1], settings
    belief, latent = (x.repeat_interleave(own.candidates, dim=1) for x in (belief, latent))
    mean, deviation = belief.new_zeros(1), belief.new_ones(1)
    for _ in range(own.iterations):
        noise = drawn(sources, number, own.candidates, own.horizon, model.action)
        actions = mean + deviation * noise  # (seeds, n, candidates, horizon, action)
        returns, (h, z) = belief.new_zeros(belief.shape[:2]), (belief, latent)
        for action in actions.flatten(1, 2).unbind(2):
            h, z, reward = model.guess(h, z, action, drawn(sources, *latent.shape[1:]))
            returns = returns + reward
        best = returns.unflatten(1, (number, -1)).topk(own.elites, sorted=False).indices
        elites = torch.take_along_dim(actions, best[..., None, None], dim=2)
        mean, deviation = elites.mean(2, True), elites.std(2, correction=0, keepdim=True)
    return mean[:, :, 0, 0]


class PlaNet:
    """PlaNet `Learner`, whose memory is the state of a world model.

    Attributes:
        settings, problem: Settings of PlaNet, and the learning problem.
        model: The world model.
        replay: The replay buffer.
        updates: Number of updates so far.
    """

    def __init__(self, settings: PlaNetSettings, problem: Problem):
        """Draws the networks and allocates the replay buffer.

        Raises:
            InvalidArgumentError: unless images are square with a power of two; for too small a
                buffer or too few channels.
        """
        self.settings, self.problem, self.updates = settings, problem, 0
        if len(problem.observation) != 3 or problem.observation[0] != problem.observation[1]:
            raise InvalidArgumentError(
                "observation", problem.observation, "'rgb', of square images"
            )
        size = problem.observation[0]
        check_count("channels", settings.channels, size // 8)  # The last layer but one has one.
        check_count("replay", settings.replay, (settings.length - 1) * problem.num_envs)
        self._sources = generators(problem.seeds, problem.device)
        self.model = WorldModel(
            self._sources, size, problem.action, belief=settings.belief, latent=settings.latent,
            hidden=settings.hidden, channels=settings.channels,
            kind=torch.bfloat16 if settings.bfloat16 else torch.float32,
        )  # fmt: skip
        if settings.fused and problem.device == "cuda":
            self.model.fuse()
        self._adam = adam(self.model.parameters(), settings.rate, eps=settings.epsilon)
        self.replay = Replay(
            settings.replay // problem.num_envs, problem.seeds, problem.num_envs,
            problem.observation, problem.action, discount=1.0, device=problem.device,
        )  # fmt: skip
        self._run_update = CudaGraph(self._update, [*self.replay.sources, *self._sources])
        self._env_steps = 0  # Env steps of each seed.

    # ------------------------------------------------------------------ acting

    @torch.no_grad()
    def act(
        self, observation: Tensor, first: Tensor, memory: Memory | None, *, explore: bool
    ) -> tuple[Tensor, Memory]:
        """Returns actions and memory; evaluations always use the same random numbers."""
        own, model, number = self.settings, self.model, observation.shape[1]
        if memory is None:
            own_sources = None if explore else generators(self.problem.seeds, self.problem.device)
            belief, latent = model.nothing(number)
            action = belief.new_zeros(*first.shape, model.action)
            memory = Memory(own_sources, belief, latent, action)
        own_sources, belief, latent, action = memory
        sources = self._sources if own_sources is None else own_sources
        going = (~first[..., None]).float()
        belief = model.advance(going * belief, going * latent, going * action)
        shares = drawn(sources, *observation.shape[1:], normal=False)
        embedding = model.encoder(centered(observation, own.bits, shares))
        noise = drawn(sources, number, own.latent)
        latent = model.posterior(belief, embedding).sample(noise)
        if explore and self._env_steps < own.random_steps:
            action = any_actions(sources, number, model.action)
        else:
            with torch.autocast(belief.device.type, torch.bfloat16, enabled=own.bfloat16):
                action = plan(model, belief, latent, sources, own)
            wide = own.noise if explore else own.evaluation_noise
            action = action + wide * drawn(sources, number, model.action)
        action = action.clamp(-1.0, 1.0)
        return action, Memory(own_sources, belief, latent, action)

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index.

        Raises:
            UnexportableError: always.
        """
        valid = "a method without memory; the actions of PlaNet depend on past observations"
        raise UnexportableError("method", "planet", valid)

    # ------------------------------------------------------------------ learning

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Adds a vector step and updates the networks; returns losses (seeds,) by name."""
        own = self.settings
        self.replay.add(step)
        learns = self._env_steps >= own.random_steps and self.replay.size >= own.length - 1
        self._env_steps += self.problem.num_envs
        result: dict[str, Tensor] = {}
        if learns:
            for _ in range(own.updates):
                result = self._run_update()
            self.updates += own.updates
        return result

    def _update(self) -> dict[str, Tensor]:
        """Makes one update; returns losses (seeds,) by name."""
        own = self.settings
        # The authors' sequences have the same number of frames, the first one without loss.
        step = self.replay.slices(own.batch, own.length - 1)
        frames = step.next_observation
        image = centered(frames, own.bits, drawn(self._sources, *frames.shape[1:], normal=False))
        noise = drawn(self._sources, *frames.shape[1:3], own.latent)
        result = losses(self.model, step, image, noise, own.free_nats)
        self._adam.zero_grad(set_to_none=True)
        torch.stack([*result.values()]).sum().backward()
        clip_grad_norm([*self.model.parameters()], len(self._sources), own.gradient_norm)
        self._adam.step()
        return {name: loss.detach() for name, loss in result.items()}

    # ------------------------------------------------------------------ state

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""
        return {
            "model": copy.deepcopy(self.model.state_dict()),
            "adam": copy.deepcopy(self._adam.state_dict()),
            "random": [source.get_state() for source in self._sources],
            "replay": self.replay.get_state(),
            "updates": self.updates,
            "seen": self._env_steps,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.model.load_state_dict(state["model"])
        self._adam.load_state_dict(copy.deepcopy(state["adam"]))
        for source, saved in zip(self._sources, state["random"], strict=True):
            source.set_state(saved)
        self.replay.set_state(state["replay"])
        self.updates, self._env_steps = state["updates"], state["seen"]


def make(settings: PlaNetSettings, problem: Problem) -> PlaNet:
    """Returns the `Learner` of a problem."""
    return PlaNet(settings, problem)
