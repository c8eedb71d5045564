"""`Learner`: the interface between a training and its method."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor, nn

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError


class UnexportableError(InvalidArgumentError):
    """Method whose policies cannot be exported: they have memory, or sample their actions."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """Learning problem: task, environments and shapes.

    Attributes:
        task: Task name.
        task_settings: Keyword arguments of the task.
        seeds: Seeds that are trained together.
        num_envs: Number of environments of each seed.
        observation: Shape of an observation; images are (height, width, 3) uint8, others (n,).
        action: Size of an action, whose entries are in -1..1.
        reward_scale: Factor of the task's rewards for learning.
        device: PyTorch device.
        observed: Name of the observation, or names of several.
        shapes: Shapes of several observations by name (`observation` is then ()); empty for one.
        env_steps: Env steps of each seed in the whole training.
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
        """Returns an environment of the task that has been reset, without images."""
        is_state = isinstance(self.observed, str) and self.observed != "rgb"
        seen = self.observed if is_state else "reduced"
        env = softgym_mj.load(self.task, split="all", observation=seen, **self.task_settings)
        env.reset(0)
        return env


class Step(NamedTuple):
    """Vector step of all environments, with arrays (seeds, num_envs, ...).

    Attributes:
        observation, action: Observation before the step, and action.
        reward: Scaled reward (seeds, num_envs).
        next_observation: Observation after the step, of the same episode even at its end.
        terminated: Whether the simulation has diverged, so that the return ends.
        ended: Whether the episode has ended or is truncated.
    """

    observation: Tensor
    action: Tensor
    reward: Tensor
    next_observation: Tensor
    terminated: Tensor
    ended: Tensor


class Learner(Protocol):
    """Protocol of learners: independent policies of several seeds that are trained together."""

    @property
    def updates(self) -> int:
        """Number of updates so far."""

    def act(
        self, observation: Tensor, first: Tensor, memory: Any, *, explore: bool
    ) -> tuple[Tensor, Any]:
        """Returns actions.

        Args:
            observation: Observations (seeds, n, ...) of any number n of environments.
            first: Whether each is the first of an episode (seeds, n).
            memory: Memory that was returned by the previous call; None at first.
            explore: Whether to explore; otherwise actions are the best known ones.

        Returns:
            Actions (seeds, n, action), and the memory for the next call.
        """

    def learn(self, step: Step) -> dict[str, Tensor]:
        """Adds a vector step and updates the policies.

        Returns:
            Losses and other metrics (seeds,) by name; empty without an update.
        """

    def policy(self, seed: int) -> nn.Module:
        """Returns the policy of the seed at an index: a module from observations to actions.

        Raises:
            UnexportableError: for a method whose policies have memory or sample their actions.
        """

    def get_state(self) -> dict[str, Any]:
        """Returns the state from which `set_state` continues exactly."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""


@dataclasses.dataclass(frozen=True)
class Method:
    """Learning method with its settings.

    Attributes:
        name: Name in `registry.METHODS`, or "module:function".
        preset: Name of the preset; "custom" if settings were replaced.
        settings: Dataclass of settings.
        make: Creates a `Learner` from settings and a problem.
    """

    name: str
    preset: str
    settings: Any
    make: Callable[[Any, Problem], Learner]


def check_random_steps(settings: Any, env_steps: int, num_envs: int) -> None:
    """Raises `InvalidArgumentError` if a method's random steps leave none to learn from.

    Args:
        settings: Settings of a method, with or without `random_steps`.
        env_steps: Env steps of each seed.
        num_envs: Number of environments of each seed.
    """
    random_steps, most = getattr(settings, "random_steps", 0), env_steps - num_envs
    if random_steps > most:
        valid = f"0 to {most}, so that {env_steps=} has a step of {num_envs=} to learn from"
        raise InvalidArgumentError("random_steps", random_steps, valid)


def split_by_seed(problem: Problem, array: Any) -> Tensor:
    """Converts an array (seeds * num_envs, ...) to (seeds, num_envs, ...) on the device."""
    if isinstance(array, Mapping):
        return {name: split_by_seed(problem, each) for name, each in array.items()}
    tensor = torch.as_tensor(array, device=problem.device)
    return tensor.reshape(len(problem.seeds), -1, *tensor.shape[1:])
