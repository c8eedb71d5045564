"""Behavior cloning of the scripted expert, for several seeds.

The loss is the squared error of the mean action. The likelihood of a tanh-squashed Gaussian would
be unbounded: experts are deterministic, with actions of -1 and 1, which tanh never reaches.
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

# Minimum standard deviation in the normalization of observations [m], so that nearly constant
# entries are not amplified.
_LEAST_DEVIATION = 0.01


@typed
@dataclasses.dataclass(frozen=True)
class BCSettings:
    """Settings of behavior cloning.

    Attributes:
        demonstrations: Number of the expert's episodes.
        jobs: Processes that play them; None for the number of cores.
        noise: Standard deviation of the noise on applied actions, as in `recording.record`; labels
            are the expert's own actions.
        symmetric: Whether sampled steps are transformed by random symmetries of the task.
        batch: Env steps in an update.
        hidden: Sizes of hidden layers.
        rate: Learning rate of Adam.

    Raises:
        InvalidArgumentError: for a value out of range.
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
    """Policy with observations normalized by the statistics of demonstrations.

    Attributes:
        seen: The normalization.
        body: The network, as SAC's mean.
    """

    def __init__(
        self, sources: Sequence[torch.Generator], shown: Tensor, action: int, hidden: Sequence[int]
    ):
        """Draws the weights.

        Args:
            sources: Random generators, one per seed.
            shown: Observations of demonstrations (..., n).
            action: Size of an action.
            hidden: Sizes of hidden layers.
        """
        super().__init__()
        self.seen = ObservationNormalizer(len(sources), shown.shape[-1], shown.device)
        self.seen.fit(shown.flatten(0, -2)[None], _LEAST_DEVIATION)
        self.body = MLP(sources, [shown.shape[-1], *hidden, action])

    def mean(self, observation: Tensor) -> Tensor:
        """Returns actions (seeds, n, action) for observations (seeds, n, observation)."""
        return torch.tanh(self.body(self.seen(observation)))


class BC:
    """`Offline` learner of behavior cloning.

    Attributes:
        actor: The networks.
        demonstrated: Number of demonstrated env steps.
        updates: Number of updates so far.
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
            settings: Settings of behavior cloning.
            seeds: Seeds of the trainings.
            shown: Demonstrations (episodes, steps, ...).
            shapes: Symmetries that transform sampled steps.
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
        """Returns actions and memory, as `Learner.act` does."""
        with torch.no_grad():
            return self.actor.mean(observation), None

    def update_offline(self) -> dict[str, Tensor]:
        """Makes one update; returns losses (seeds,) by name."""
        self.updates += 1
        return self._repeated()

    def loss(self, batch: Batch) -> Tensor:
        """Returns the mean squared error of actions (seeds,)."""
        return ((self.actor.mean(batch.observation) - batch.action) ** 2).mean((1, 2))

    def _update(self) -> dict[str, Tensor]:
        loss = self.loss(self._replay.sample(self._settings.batch))
        step(self._adam, loss)
        return {"loss": loss.detach()}

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index."""
        return DeterministicPolicy(self.actor, seed)

    def get_state(self) -> dict[str, Any]:
        """Returns the state for `set_state`, without demonstrations, which are in the cache."""
        state = {
            "actor": self.actor.state_dict(),
            "adam": self._adam.state_dict(),
            "random": [source.get_state() for source in self._replay.sources],
            "updates": self.updates,
        }
        return copy.deepcopy(state)  # Training changes the arrays in place.

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
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
