"""`DeformableTask`: variations, one evaluation a step, observations and snapshots."""

import abc
import collections
import dataclasses
from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj import metrics
from softgym_mj.entities.arena import Arena
from softgym_mj.exceptions import (
    EpisodeEndedError,
    OutOfRangeError,
    SoftGymError,
    UndrivenError,
    check_count,
    check_image_size,
)
from softgym_mj.rendering.observables import TaskCamera
from softgym_mj.rendering.offscreen import LARGEST_IMAGE
from softgym_mj.robots.base import SIM_STEP, Actor
from softgym_mj.tasks.evaluation import Evaluation, check_names
from softgym_mj.tasks.observations import enabled_names
from softgym_mj.variations.randomization import Adjustable, Domain
from softgym_mj.variations.store import check_variation


@dataclasses.dataclass(frozen=True)
class Entries:
    """Consecutive entries of a state.

    Attributes:
        name: what they are, in their order.
        number: how many there are.
        unit: their unit, "" for none.
    """

    name: str
    number: int
    unit: str


class TaskSettings(TypedDict, total=False):
    """Keyword arguments that tasks pass on to `DeformableTask`, where they are described."""

    observation: str | Sequence[str]
    image_size: tuple[int, int]
    action_repeat: int
    domain: str | Mapping[str, object]


class DeformableTask(composer.Task, abc.ABC):
    """A task on flexes or water with one actor.

    `FlexTask`, `WaterTask` and `SceneTask` say what a state is; their subclasses what is measured
    and where things start.

    Attributes:
        driven: whether an `Environment` passes actions on to the actor.
    """

    driven = False

    def __init__(
        self,
        arena: Arena,
        actor: Actor,
        *,
        timestep: float,
        success: float,
        max_points: int,
        adjustable: Sequence[Adjustable],
        observation: str | Sequence[str],
        image_size: tuple[int, int],
        action_repeat: int,
        domain: str | Mapping[str, object] = "nominal",
    ):
        """Wires the parts together.

        Args:
            arena: the scene, with everything in it.
            actor: what acts.
            timestep: physics step [s] that the object needs; it divides the sim step.
            success: normalised performance from which the goal counts as reached.
            max_points: most points of any variation; the full state is zero-padded to it.
            adjustable: what of the scene has domain parameters, besides the arena.
            observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
            image_size: (height, width) of image observations [pixels].
            action_repeat: sim steps of 0.01 s per env step.
            domain: what varies besides the initial state, as in `Domain`.
        """
        check_count("action_repeat", action_repeat, 1)
        image_size = check_image_size("image_size", image_size, LARGEST_IMAGE)
        self._domain = Domain(domain, (arena, *adjustable))
        self._arena, self._actor = arena, actor
        self._success, self._max_points = success, max_points
        self._action_repeat = action_repeat
        self.set_timesteps(control_timestep=action_repeat * SIM_STEP, physics_timestep=timestep)
        self._observables = collections.OrderedDict(
            full=observable.Generic(lambda physics: self.full_state()),
            reduced=observable.Generic(lambda physics: self.reduced_state()),
            full_mask=observable.Generic(lambda physics: self.full_mask()),
            proprioception=observable.Generic(lambda physics: actor.proprioception()),
            **TaskCamera(*image_size, lambda: self.parts).observables(),
            **actor.own_observables(*image_size),
            **self.own_observables(*image_size),
        )
        for name in enabled_names(observation, self._observables):
            self._observables[name].enabled = True
        self._variation = 0
        self._initial_performance = 0.0
        self._evaluation: Evaluation | None = None
        self._named = False  # Whether the names in info have been checked.
        self._arguments: dict[str, str] = {}

    # ------------------------------------------------------------------ parts

    @property
    def root_entity(self) -> Arena:
        if "_arena" not in vars(self):
            raise SoftGymError("the scene does not exist yet: call super().__init__ first")
        return self._arena

    @property
    def actor(self) -> Actor:
        """What acts."""
        return self._actor

    @property
    def domain(self) -> Domain:
        """What varies besides the initial state."""
        return self._domain

    @property
    def success_threshold(self) -> float:
        """Normalised performance from which the goal counts as reached."""
        return self._success

    @property
    def action_repeat(self) -> int:
        """Sim steps per env step."""
        return self._action_repeat

    @property
    def task_observables(self):
        return self._observables

    # ------------------------------------------------------------------ what a task defines

    @abc.abstractmethod
    def evaluate(self) -> Evaluation:
        """Measures the current state and changes nothing: `set_state` calls it once more."""

    @abc.abstractmethod
    def bounds(self) -> tuple[float, float]:
        """(lower, upper) performance that normalise to 0 and 1 in this episode."""

    @abc.abstractmethod
    def begin(self) -> None:
        """Puts everything where an episode of the current variation starts."""

    @abc.abstractmethod
    def points(self) -> np.ndarray:
        """All points (n, 3) [m] of what deforms or flows."""

    @abc.abstractmethod
    def tool_state(self) -> np.ndarray:
        """What the full state tells of grippers or cups, behind the points: numbers (n,)."""

    @abc.abstractmethod
    def reduced_state(self) -> np.ndarray:
        """The few numbers (n,) that describe the state."""

    @property
    @abc.abstractmethod
    def reduced_entries(self) -> tuple[Entries, ...]:
        """What the reduced state lists, up to what the actor senses of itself."""

    @property
    def tool_entries(self) -> tuple[Entries, ...]:
        """What the full state lists between the points and what the actor senses of itself."""
        return ()

    @property
    @abc.abstractmethod
    def parts(self) -> dict[str, tuple[str, ...]]:
        """Names of the models that segmented images show as "actor", "container" or "goal"."""

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        """Further observables by name, with images of height x width pixels."""
        return {}

    def diagnostics(self) -> dict[str, float | int]:
        """Further scalars for info."""
        return {}

    def resize(self, variation: int) -> bool:
        """Fits the model to a variation; returns True when it changed and must be recompiled."""
        return False

    # ------------------------------------------------------------------ episode

    @property
    def variation(self) -> int:
        """Index of the current variation."""
        return self._variation

    def choose_variation(self, variation: int) -> bool:
        """Sets the variation of the next episode; True when the model must be recompiled."""
        self._variation = check_variation(variation)
        resized = self.resize(self._variation)
        if not isinstance(resized, (bool, np.bool_)):
            raise OutOfRangeError("resize()", resized, "True if the model changed, else False")
        return self._domain.apply(self._variation) or resized

    def initialize_episode(self, physics, random_state):
        self.begin()
        self._evaluation = self._evaluated()
        self._initial_performance = self._evaluation.performance
        if not self._named:
            names = self._evaluation.measures, self.diagnostics(), self._actor.diagnostics()
            check_names(names)
            self._named = True

    def _evaluated(self) -> Evaluation:
        evaluation = self.evaluate()
        if not isinstance(evaluation, Evaluation):
            raise OutOfRangeError("evaluate()", evaluation, "an `Evaluation`")
        return evaluation

    def before_step(self, physics, action, random_state):
        # Our environment drives the actor; the base class would write `ctrl`.
        if not self.driven:
            raise UndrivenError(
                "composer's own Environment does not drive the actor of a DeformableTask: "
                "run it in softgym_mj.envs.environment.Environment, or by softgym_mj.load"
            )

    def after_step(self, physics, random_state):
        self._evaluation = self._evaluated()

    def action_spec(self, physics) -> specs.BoundedArray:
        return self._actor.action_spec(physics)

    def get_reward(self, physics) -> float:
        return self.last_evaluation.reward

    @property
    def last_evaluation(self) -> Evaluation:
        """Evaluation of the state after the last env step or reset."""
        if self._evaluation is None:
            raise EpisodeEndedError("no episode has started: call reset() first")
        return self._evaluation

    @property
    def initial_performance(self) -> float:
        """Performance at reset."""
        return self._initial_performance

    def info(self) -> dict[str, float | int | bool]:
        """Scalars of the last evaluation; the reward is the sum of the "reward_*" entries."""
        evaluation = self.last_evaluation
        normalized = metrics.normalize(evaluation.performance, *self.bounds())
        return {
            "performance": evaluation.performance,
            "normalized_performance": normalized,
            "success": bool(normalized >= self._success),
            **{f"reward_{name}": value for name, value in evaluation.reward_terms.items()},
            **evaluation.measures,
            **self.diagnostics(),
            **self._actor.diagnostics(),
            **{f"domain_{name}": self._domain.values[name] for name in self._domain.varying},
            "variation": self._variation,
        }

    def full_state(self) -> np.ndarray:
        """All points (x, y, z each), zeros up to `max_points`, then `tool_state`."""
        points, tool = self.points().ravel(), self.tool_state().ravel()
        state = np.zeros(3 * self._max_points + tool.size)
        state[: points.size] = points
        state[3 * self._max_points :] = tool
        return state

    def full_mask(self) -> np.ndarray:
        """1 for each of the points of `full_state` that exists, else 0: (max_points,) uint8."""
        return (np.arange(self._max_points) < len(self.points())).astype(np.uint8)

    # ------------------------------------------------------------------ snapshots

    @property
    def state_layout(self) -> dict[str, object]:
        """What must agree for a state of one instance to fit into another."""
        return {
            "actor": type(self._actor).__name__,
            "action size": self._actor.action_size,
            "most points (fidelity)": self._max_points,
            "action repeat": self._action_repeat,
            "domain": {name: self._domain.ranges[name] for name in self._domain.varying},
            **({"arguments": self._arguments} if self._arguments else {}),
        }

    def remember_arguments(self, arguments: Mapping[str, str]) -> None:
        """Makes the arguments that it was built with, as text, part of `state_layout`."""
        self._arguments = dict(arguments)

    def get_state(self) -> dict[str, object]:
        """What the task and its actor remember and mjData does not hold.

        A task that remembers something of its own adds it: `{**super().get_state(), ...}`.
        """
        return {
            "variation": self._variation,
            "initial_performance": self._initial_performance,
            "actor": self._actor.get_state(),
        }

    def set_state(self, state: dict) -> None:
        """Restores what `get_state` returned, after mjData has been restored; then evaluates.

        A task that remembers something of its own takes it back before it calls this.
        """
        self._initial_performance = state["initial_performance"]
        self._actor.set_state(state["actor"])
        self._evaluation = self._evaluated()
