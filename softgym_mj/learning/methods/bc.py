"""Behavior cloning: a policy does what the expert did in its place, of several seeds at once.

Its loss is the squared error of the mean action. The likelihood of a Gaussian through tanh has no
bound here: experts are deterministic, and grips and fast moves are at -1 and 1, which tanh never
reaches. Evaluations play the mean action anyway.
"""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from softgym_mj.exceptions import check_count, check_number
from softgym_mj.learning.cuda_graph import CudaGraph
from softgym_mj.learning.demonstrations import check_demonstrations, collect, replay_of
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.networks import MLP, DeterministicPolicy, ObservationNormalizer, generators
from softgym_mj.learning.optimization import adam, step
from softgym_mj.learning.replay import Batch
from softgym_mj.learning.symmetries import Symmetry, symmetries
from softgym_mj.recording.noise import check_noise
from softgym_mj.validation import typed

# Least deviation by which observations are divided [m]: what hardly changes is not blown up.
_LEAST_DEVIATION = 0.01


@typed
@dataclasses.dataclass(frozen=True)
class BCSettings:
    """How it learns, and from how much.

    Attributes:
        demonstrations: episodes of the expert.
        jobs: processes that play them; None for as many as there are cores.
        noise: deviation of the noise on what they apply, as in `recording.record`; what is learned
            are the actions of the expert itself.
        symmetric: whether demonstrations show the symmetries of the task.
        batch: env steps of an update.
        hidden: sizes of hidden layers.
        rate: of Adam.

    Raises:
        InvalidArgumentError: for numbers out of range.
    """

    demonstrations: int = 200
    jobs: int | None = None
    noise: float = 0.0
    symmetric: bool = False
    batch: int = 256
    hidden: tuple[int, ...] = (512, 512, 512)
    rate: float = 3e-4

    def __post_init__(self):
        check_demonstrations(self.demonstrations, self.jobs)
        check_noise(self.noise)
        check_count("batch", self.batch, 1)
        check_number("rate", self.rate, gt=0.0, le=1.0)


class Clone(nn.Module):
    """Actions as functions of observations, which are standardized as those of demonstrations.

    Attributes:
        seen: makes of observations what the network takes.
        body: the network, as SAC's of the mean.
    """

    def __init__(
        self, sources: Sequence[torch.Generator], shown: Tensor, action: int, hidden: Sequence[int]
    ):
        """Draws the weights.

        Args:
            sources: of random numbers, one a seed.
            shown: observations (..., n).
            action: size.
            hidden: sizes of hidden layers.
        """
        super().__init__()
        self.seen = ObservationNormalizer(len(sources), shown.shape[-1], shown.device)
        self.seen.fit(shown.flatten(0, -2)[None], _LEAST_DEVIATION)
        self.body = MLP(sources, [shown.shape[-1], *hidden, action])

    def mean(self, observation: Tensor) -> Tensor:
        """Returns actions (seeds, n, action) for observations (seeds, n, observation)."""
        return torch.tanh(self.body(self.seen(observation)))


class BC:
    """An `Offline` learner.

    Attributes:
        actor: the networks.
        demonstrated: env steps of the demonstrations.
        updates: how many there were.
    """

    def __init__(
        self,
        settings: BCSettings,
        seeds: Sequence[int],
        shown: Step,
        shapes: Sequence[Symmetry] = (),
    ):
        """Draws the networks.

        Args:
            settings: how it learns.
            seeds: of the random numbers, each of a training of its own.
            shown: demonstrations (episodes, steps, ...).
            shapes: symmetries by which they are shown.
        """
        self._settings, sources = settings, generators(seeds, shown.reward.device)
        size = shown.action.shape[-1]
        self.actor = Clone(sources, shown.observation, size, settings.hidden)
        self.demonstrated, self.updates = shown.reward.numel(), 0
        self._replay = replay_of(shown, seeds, symmetries=shapes)
        self._adam = adam(self.actor.parameters(), settings.rate)
        self._repeated = CudaGraph(self._update, self._replay.sources)

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """See `Learner`."""
        with torch.no_grad():
            return self.actor.mean(observation), None

    def update_offline(self) -> dict[str, Tensor]:
        """See `Offline`."""
        self.updates += 1
        return self._repeated()

    def loss(self, batch: Batch) -> Tensor:
        """Of each seed (seeds,): the mean squared error of actions."""
        return ((self.actor.mean(batch.observation) - batch.action) ** 2).mean((1, 2))

    def _update(self) -> dict[str, Tensor]:
        loss = self.loss(self._replay.sample(self._settings.batch))
        step(self._adam, loss)
        return {"loss": loss.detach()}

    def policy(self, seed: int) -> nn.Module:
        """See `Learner`."""
        return DeterministicPolicy(self.actor, seed)

    def get_state(self) -> dict[str, Any]:
        """See `Learner`; demonstrations are in the cache."""
        state = {
            "actor": self.actor.state_dict(),
            "adam": self._adam.state_dict(),
            "random": [source.get_state() for source in self._replay.sources],
            "updates": self.updates,
        }
        return copy.deepcopy(state)  # What is in them goes on changing.

    def set_state(self, state: Mapping[str, Any]) -> None:
        """See `Learner`."""
        self.actor.load_state_dict(state["actor"])
        self._adam.load_state_dict(copy.deepcopy(state["adam"]))
        for source, saved in zip(self._replay.sources, state["random"], strict=True):
            source.set_state(saved)
        self.updates = state["updates"]


def make(settings: BCSettings, problem: Problem) -> BC:
    """Creates the learner of a problem, after collecting missing demonstrations."""
    shapes = symmetries(problem.example()) if settings.symmetric else ()
    shown = collect(problem, settings.demonstrations, settings.jobs, noise=settings.noise)
    return BC(settings, problem.seeds, shown, shapes)
