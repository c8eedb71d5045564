"""`DeformableTask`: variations, one evaluation a step, observations and snapshots."""

import abc
import collections
import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import TypedDict

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj import metrics
from softgym_mj.entities.arena import Arena
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    SoftGymError,
    check_count,
    check_image_size,
)
from softgym_mj.metrics import Array, Measures
from softgym_mj.rendering.observables import TaskCamera
from softgym_mj.rendering.offscreen import LARGEST_IMAGE
from softgym_mj.robots.base import SIM_STEP, Actor
from softgym_mj.tasks.shared.checks import check_names, checked
from softgym_mj.tasks.shared.observations import enabled_names
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import SPLITS, check_variation
from softgym_mj.variations.randomization import Adjustable, Domain


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
        driven: whether an `Environment` makes as many sim steps as an action takes.
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
        self._substep = 0  # Of the env step.
        self._variation, self._chosen = 0, False
        self._episode: Episode | None = None
        self._present: dict[str, np.ndarray] = {}
        self._measures: Measures | None = None
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
    def measure(self, state: State, episode: Episode) -> Measures:
        """Measures a state and changes nothing: `set_state` calls it once more.

        The tasks of the package are functions of these arrays alone, of one simulation or of many.
        """

    @abc.abstractmethod
    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        """(lower, upper) performance (...) that normalise to 0 and 1 in an episode."""

    @abc.abstractmethod
    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        """The few numbers that describe the state: (..., k) by what they are, with their unit.

        What the actor senses of itself follows by itself.
        """

    def beside(self, state: State, episode: Episode) -> dict[str, Array]:
        """What the full state lists between the points and what the actor senses, as `reduced`."""
        return {}

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What an episode's measures compare with: arrays by name.

        Args:
            variation: index.
            points: (n, 3) [m] of each object at the start, by name.
        """
        return {}

    def show(self, goal: dict[str, np.ndarray]) -> None:
        """Draws the goal of an episode that starts."""

    @abc.abstractmethod
    def begin(self) -> None:
        """Puts everything where an episode of the current variation starts."""

    @abc.abstractmethod
    def object_points(self) -> dict[str, np.ndarray]:
        """Points (n, 3) [m] of each object that deforms or flows, by name."""

    @abc.abstractmethod
    def sensed(self) -> np.ndarray:
        """What the actor senses of itself at the end of the full and the reduced state: (n,)."""

    def poses(self) -> dict[str, np.ndarray]:
        """Poses (8,) of cups by name, as in `State`."""
        return {}

    def shapes(self) -> dict[str, dict[str, np.ndarray]]:
        """What depends on the sizes of objects, by object and name."""
        return {}

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
        self._variation, self._chosen = check_variation(variation), True
        resized = self.resize(self._variation)
        if not isinstance(resized, (bool, np.bool_)):
            raise InvalidArgumentError("resize()", resized, "True if the model changed, else False")
        return self._domain.apply(self._variation) or resized

    def after_compile(self, physics, random_state):
        self._episode, self._present = None, {}  # Sizes are others.
        physics.legacy_step = False  # Steps are whole: what holds vertices sets velocities before.

    def start_points(self) -> dict[str, np.ndarray]:
        """Points (n, 3) [m] of each object as the episode starts."""
        return self.object_points()

    def _new_episode(self) -> Episode:
        points = self.start_points()
        goal = self.goal(self._variation, points)
        return Episode(self._variation, points, self.shapes(), goal, 0.0)

    def initialize_episode(self, physics, random_state):
        self.begin()
        self._episode = self._new_episode()
        self.show(self._episode.goal)
        self._measures = self._measured()
        initial = self._measures.performance
        self._episode = dataclasses.replace(self._episode, initial_performance=initial)
        if not self._named:
            check_names((self._measures.info, self.diagnostics(), self._actor.diagnostics()))
            self._named = True

    def points(self) -> np.ndarray:
        """All points (n, 3) [m] of what deforms or flows."""
        return np.concatenate(list(self.object_points().values()))

    def state(self) -> State:
        """The current state."""
        points = self.object_points()
        if not self._present:
            self._present = {name: np.ones(len(array), bool) for name, array in points.items()}
        return State(points, self._present, self.poses(), self.sensed())

    def _measured(self) -> Measures:
        return checked(self.measure(self.state(), self.episode))

    def initialize_episode_mjcf(self, random_state):
        if not self._chosen:  # By nobody, as in composer's own Environment.
            self.choose_variation(int(random_state.choice(SPLITS["train"])))
        self._chosen = False

    def set_timesteps(self, control_timestep: float, physics_timestep: float) -> None:
        super().set_timesteps(control_timestep, physics_timestep)
        self._timestep = physics_timestep  # Looked up in the model, it would take long.
        self._parts_of_sim_step = round(SIM_STEP / physics_timestep)

    def before_step(self, physics, action, random_state):
        actor = self._actor
        action = actor.checked_action(action)
        if actor.sim_steps is not None and not self.driven:
            raise LifecycleError(
                "actions of this actor take as long as they need: run the task in "
                "softgym_mj.envs.environment.Environment, or by softgym_mj.load"
            )
        actor.command(action)
        self._substep = 0

    def before_substep(self, physics, action, random_state):
        part = self._substep % self._parts_of_sim_step
        if part == 0:
            self._actor.plan()
        self._actor.move((part + 1) / self._parts_of_sim_step, self._timestep)
        self._substep += 1

    def after_step(self, physics, random_state):
        self._measures = self._measured()

    def action_spec(self, physics) -> specs.BoundedArray:
        return self._actor.action_spec(physics)

    def get_reward(self, physics) -> float:
        return self.last_evaluation.reward

    @property
    def episode(self) -> Episode:
        """What the episode started with; before, what is there: specifications are read off it."""
        if self._episode is None:
            self._episode = self._new_episode()
        return self._episode

    @property
    def last_evaluation(self) -> Measures:
        """Measures of the state after the last env step or reset."""
        if self._measures is None:
            raise LifecycleError("no episode has started: call reset() first")
        return self._measures

    def normalized(self, performance: Array) -> Array:
        """A performance of this episode in terms of its bounds."""
        return metrics.normalize(performance, *self.bounds(self.episode))

    def info(self) -> dict[str, float | int | bool]:
        """Scalars of the last evaluation; the reward is the sum of the "reward_*" entries."""
        measures = self.last_evaluation
        normalized = self.normalized(measures.performance)
        return {
            "performance": measures.performance,
            "normalized_performance": normalized,
            "success": bool(normalized >= self._success),
            **{f"reward_{name}": value for name, value in measures.rewards.items()},
            **measures.info,
            **self.diagnostics(),
            **self._actor.diagnostics(),
            **{f"domain_{name}": self._domain.values[name] for name in self._domain.varying},
            "variation": self._variation,
        }

    def reduced_state(self) -> np.ndarray:
        """The numbers of `reduced`, then what the actor senses of itself: (n,)."""
        state = self.state()
        return flat([*self.reduced(state, self.episode).values(), state.sensed])

    def full_state(self) -> np.ndarray:
        """All points (x, y, z each), zeros, `beside`, what the actor senses: (n,)."""
        state = self.state()
        points = flat(state.points.values())
        padding = np.zeros(3 * self._max_points - points.size)
        beside = self.beside(state, self.episode).values()
        return flat([points, padding, *beside, state.sensed])

    def full_mask(self) -> np.ndarray:
        """1 for each of the points of `full_state` that exists, else 0: (max_points,) uint8."""
        return (np.arange(self._max_points) < len(self.points())).astype(np.uint8)

    # ------------------------------------------------------------------ snapshots

    @property
    def state_layout(self) -> dict[str, object]:
        """What must agree for a state of one instance to fit into another."""
        return {
            "actor": self._actor.name,
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
            "initial_performance": self.episode.initial_performance,
            "actor": self._actor.get_state(),
        }

    def set_state(self, state: dict) -> None:
        """Restores what `get_state` returned, after mjData has been restored; then evaluates.

        A task that remembers something of its own takes it back before it calls this.
        """
        initial = state["initial_performance"]
        self._episode = dataclasses.replace(self.episode, initial_performance=initial)
        self._actor.set_state(state["actor"])
        self._measures = self._measured()


def flat(arrays: Iterable[np.ndarray]) -> np.ndarray:
    """All numbers of some arrays in one (n,)."""
    return np.concatenate([np.ravel(array) for array in arrays])
