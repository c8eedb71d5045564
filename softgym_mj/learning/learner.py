"""`Learner`: what a method is to a training. A method is a file that has one, and its settings."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import torch
from torch import Tensor, nn

import softgym_mj
from softgym_mj.envs.environment import Environment


@dataclasses.dataclass(frozen=True)
class Problem:
    """What is to be learned.

    Attributes:
        task: its name.
        task_settings: keyword arguments of the task.
        seeds: of trainings that go side by side.
        num_envs: environments of each seed.
        observation: shape of one; images are (height, width, 3) uint8, all else is (n,).
        action: size of one, in -1..1.
        reward_scale: factor to the task's rewards, in those that are learned from.
        device: of PyTorch.
        observed: name of what is observed, or names of several observations.
        shapes: of several observations by name, `observation` being (); empty for a single one.
        env_steps: env steps of each seed in the whole training.
    """

    task: str
    task_settings: Mapping[str, Any]
    seeds: Sequence[int]
    num_envs: int
    observation: tuple[int, ...]
    action: int
    reward_scale: float
    device: str
    observed: str | tuple[str, ...] = "reduced"
    shapes: Mapping[str, tuple[int, ...]] = dataclasses.field(default_factory=dict)
    env_steps: int = 0

    def example(self) -> Environment:
        """An environment of the task that has been reset, without images."""
        is_state = isinstance(self.observed, str) and self.observed != "rgb"
        seen = self.observed if is_state else "reduced"
        env = softgym_mj.load(self.task, split="all", observation=seen, **self.task_settings)
        env.reset(0)
        return env


class Step(NamedTuple):
    """A step of all environments, (seeds, num_envs, ...) each.

    Attributes:
        observation, action: what was seen, and done.
        reward: scaled, (seeds, num_envs).
        next_observation: of the same episode, at its end too.
        terminated: whether the simulation has diverged: nothing follows.
        ended: whether the episode is over for any reason, or is not followed any further.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    next_observation: Tensor
    terminated: Tensor
    ended: Tensor


class Learner(Protocol):
    """Policies of several seeds, which learn side by side and know nothing of each other."""

    @property
    def updates(self) -> int:
        """How many there were."""

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Chooses actions.

        Args:
            observation: (seeds, n, ...), n being the environments of a seed or any other number.
            first: whether each is the first of an episode (seeds, n).
            memory: what was returned with the actions before; None at first.
            explore: whether to learn from it; else these are the best that are known.

        Returns:
            Actions (seeds, n, action), and what it is to be told the next time.
        """

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Learns from a step of all environments, and from all before.

        Returns:
            Losses and the like (seeds,) by name, if there was an update.
        """

    def policy(self, seed: int) -> nn.Module:
        """Best actions (n, action) of the seed at a place, as a function of observations.

        Raises:
            InvalidArgumentError: of a method whose actions depend on what was seen before.
        """

    def get_state(self) -> dict[str, Any]:
        """All that `set_state` needs to go on with the same numbers."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Goes on from what `get_state` returned."""


@runtime_checkable
class Offline(Protocol):
    """A `Learner` that has all it learns from: instead of `learn` it has this.

    Attributes:
        demonstrated: env steps of each seed that it learns from.
    """

    demonstrated: int

    def update_offline(self) -> dict[str, Tensor]:
        """Learns once; returns losses and the like (seeds,) by name."""


@dataclasses.dataclass(frozen=True)
class Method:
    """One way to learn.

    Attributes:
        name: of `registry.METHODS`.
        preset: whose settings these are; "custom" if some were replaced.
        settings: its dataclass.
        make: a `Learner` of a problem.
    """

    name: str
    preset: str
    settings: Any
    make: Callable[[Any, Problem], Learner]


def split_by_seed(problem: Problem, array: Any) -> Tensor:
    """Returns an array (seeds * num_envs, ...) as (seeds, num_envs, ...) on its device."""
    if isinstance(array, Mapping):
        return {name: split_by_seed(problem, each) for name, each in array.items()}
    tensor = torch.as_tensor(array, device=problem.device)
    return tensor.reshape(len(problem.seeds), -1, *tensor.shape[1:])
