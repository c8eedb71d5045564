"""PlaNet (Hafner et al., 2019): plans in the latents of a world model of images, of several seeds.

By SoftGym's authors' code (softagent's `planet/`), with their weights of losses, noises and
planner. Two things are as they must be here: actions are clipped before they are kept, as
environments clip or refuse them; and a stretch that goes on in another episode begins anew there,
where the authors only set the latent to zero. torchrl's `CEMPlanner` clips all candidates, and its
`DreamerModelLoss` mixes seeds.
"""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods.planet.latent import WorldModel, centered
from softgym_mj.learning.networks import any_actions, drawn, generators
from softgym_mj.learning.optimization import adam, clip_grad_norm
from softgym_mj.learning.replay import Replay
from softgym_mj.validation import typed


@typed
@dataclasses.dataclass(frozen=True)
class PlaNetSettings:
    """How it learns and plans; the defaults are the paper's.

    Attributes:
        random_steps: env steps of each seed that are random, before it learns.
        updates: for each step of all environments.
        batch: stretches of an update, of each seed.
        length: frames of a stretch.
        replay: env steps of each seed that are kept.
        bits: of each color of a pixel, of the eight that there are.
        noise: deviation of what is added to actions that are learned from.
        evaluation_noise: the same, of those that are evaluated.
        belief, latent, hidden: sizes, the last of hidden layers.
        channels: of the encoder's last layer.
        free_nats: divergences of latents below this cost as much as this.
        rate, epsilon: of Adam.
        gradient_norm: largest of all weights of a seed together.
        horizon: env steps of a plan.
        iterations: how often the plans' distribution is fitted.
        candidates, elites: plans of an iteration, and those of them that it is fitted to.
        bfloat16: whether convolutions and plans calculate in bfloat16, with weights of 32 bits.
        fused: whether, on a GPU, what is done in each step of time is compiled (`torch.compile`,
            which takes about a minute at first).

    Raises:
        InvalidArgumentError: for numbers out of range.
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
    """Belief about the environments (seeds, n, ...), and an evaluation's random numbers."""

    sources: list[torch.Generator] | None
    belief: Tensor
    latent: Tensor
    action: Tensor


def losses(
    model: WorldModel, step: Step, image: Tensor, noise: Tensor, free_nats: float
) -> dict[str, Tensor]:
    """Of each seed (seeds,), by name; the model follows their sum.

    Args:
        model: what is learned.
        step: stretches (seeds, n, steps, ...).
        image: after each step (seeds, n, steps, size, size, 3), in -0.5..0.5.
        noise: of the latents (seeds, n, steps, latent).
        free_nats: as of `PlaNetSettings`.
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
    """First actions (seeds, n, action) of plans with high sums of rewards, not clipped.

    The cross-entropy method, from standard normal numbers at each decision; actions are the means
    of the last distribution.

    Args:
        model: what predicts rewards.
        belief, latent: where plans begin (seeds, n, ...).
        sources: of random numbers.
        settings: of the planner.
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
    """A `Learner`, with the memory of a world model.

    Attributes:
        settings, problem: how, and what.
        model: of the world.
        replay: what it learns from.
        updates: as of `Learner`.
    """

    def __init__(self, settings: PlaNetSettings, problem: Problem):
        """Draws the networks and makes room for the replay.

        Raises:
            InvalidArgumentError: without square images of a power of two, or for too small a
                replay or too few channels.
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
        self._few = CudaGraph(self._update, [*self.replay.sources, *self._sources])
        self._seen = 0  # Env steps of each seed.

    # ------------------------------------------------------------------ acting

    @torch.no_grad()
    def act(
        self, observation: Tensor, first: Tensor, memory: Memory | None, *, explore: bool
    ) -> tuple[Tensor, Memory]:
        """See `Learner`; evaluations have random numbers of their own, always the same."""
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
        if explore and self._seen < own.random_steps:
            action = any_actions(sources, number, model.action)
        else:
            with torch.autocast(belief.device.type, torch.bfloat16, enabled=own.bfloat16):
                action = plan(model, belief, latent, sources, own)
            wide = own.noise if explore else own.evaluation_noise
            action = action + wide * drawn(sources, number, model.action)
        action = action.clamp(-1.0, 1.0)
        return action, Memory(own_sources, belief, latent, action)

    def policy(self, seed: int) -> nn.Module:
        """See `Learner`.

        Raises:
            InvalidArgumentError: always.
        """
        valid = "one whose actions follow from what is seen now: these depend on the past, too"
        raise InvalidArgumentError("method", "planet", valid)

    # ------------------------------------------------------------------ learning

    def learn(self, step: Step) -> dict[str, Tensor]:
        """See `Learner`."""
        own = self.settings
        self.replay.add(step)
        learns = self._seen >= own.random_steps and self.replay.size >= own.length - 1
        self._seen += self.problem.num_envs
        result: dict[str, Tensor] = {}
        if learns:
            for _ in range(own.updates):
                result = self._few()
            self.updates += own.updates
        return result

    def _update(self) -> dict[str, Tensor]:
        """One update."""
        own = self.settings
        # As many frames as the authors', whose first one has no part in losses.
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
        """See `Learner`."""
        return {
            "model": copy.deepcopy(self.model.state_dict()),
            "adam": copy.deepcopy(self._adam.state_dict()),
            "random": [source.get_state() for source in self._sources],
            "replay": self.replay.get_state(),
            "updates": self.updates,
            "seen": self._seen,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """See `Learner`."""
        self.model.load_state_dict(state["model"])
        self._adam.load_state_dict(copy.deepcopy(state["adam"]))
        for source, saved in zip(self._sources, state["random"], strict=True):
            source.set_state(saved)
        self.replay.set_state(state["replay"])
        self.updates, self._seen = state["updates"], state["seen"]


def make(settings: PlaNetSettings, problem: Problem) -> PlaNet:
    """Returns the `Learner` of a problem."""
    return PlaNet(settings, problem)
