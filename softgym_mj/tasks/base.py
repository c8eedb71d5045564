"""What all tasks share: one deformable object, one actor, variations, one evaluation a step."""

import abc
import collections
import dataclasses
from collections.abc import Sequence

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj import metrics
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import check_count, check_image_size
from softgym_mj.observations import CameraObservable, enabled_names
from softgym_mj.rendering import LARGEST_IMAGE
from softgym_mj.robots.base import SIM_STEP, Actor, Workspace
from softgym_mj.variations import VariationStore, check_variation


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """The one evaluation of an env step that feeds reward, info and logs.

    Attributes:
        performance: SoftGym's task metric in its own unit.
        reward_terms: named terms whose sum is the reward.
        measures: further task-specific scalars for info.
    """

    performance: float
    reward_terms: dict[str, float]
    measures: dict[str, float]

    @property
    def reward(self) -> float:
        return sum(self.reward_terms.values())


@dataclasses.dataclass(frozen=True)
class Layout:
    """The fixed numbers of a task.

    Attributes:
        camera: name of its camera in `arena.CAMERAS`.
        workspace: of the grippers, as written in SoftGym; re-centred on the object at reset.
        reset_height: height of the grippers at reset, above the centre of the object [m].
        success: normalised performance from which the goal counts as reached.
        max_vertices: most vertices of any variation; the full state is zero-padded to it.
    """

    camera: str
    workspace: Workspace
    reset_height: float
    success: float
    max_vertices: int


class DeformableTask(composer.Task, abc.ABC):
    """A task on one flex. Subclasses say what is measured and where things start."""

    def __init__(
        self,
        layout: Layout,
        target: Flex,
        actor: Actor,
        store: VariationStore,
        *,
        observation: str | Sequence[str],
        image_size: tuple[int, int],
        action_repeat: int,
    ):
        """Wires the parts together.

        Args:
            layout: the fixed numbers.
            target: the object, not yet attached.
            actor: what acts, not yet attached.
            store: the initial states.
            observation: "full", "reduced", "rgb" or a sequence of these.
            image_size: (height, width) of image observations [pixels].
            action_repeat: sim steps of 0.01 s per env step.
        """
        check_count("action_repeat", action_repeat, 1)
        image_size = check_image_size("image_size", image_size, LARGEST_IMAGE)
        names = enabled_names(observation)
        self._layout, self._target, self._actor, self._store = layout, target, actor, store
        self._arena = Arena(camera=layout.camera)
        self._arena.attach(target)
        actor.join(self._arena)
        actor.manipulate(target)
        self._action_repeat = action_repeat
        self.set_timesteps(
            control_timestep=action_repeat * SIM_STEP, physics_timestep=target.timestep
        )
        self._observables = collections.OrderedDict(
            full=observable.Generic(lambda physics: self.full_state()),
            reduced=observable.Generic(lambda physics: self.reduced_state()),
            rgb=CameraObservable("task", *image_size),
        )
        for name in names:
            self._observables[name].enabled = True
        self._variation = 0
        self._initial_performance = 0.0
        self._evaluation: Evaluation | None = None

    # ------------------------------------------------------------------ parts

    @property
    def root_entity(self) -> Arena:
        return self._arena

    @property
    def target(self) -> Flex:
        """The deformable object."""
        return self._target

    @property
    def actor(self) -> Actor:
        return self._actor

    @property
    def store(self) -> VariationStore:
        """Where the initial states come from."""
        return self._store

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
        """Measures the current state."""

    @abc.abstractmethod
    def bounds(self) -> tuple[float, float]:
        """(lower, upper) performance that normalise to 0 and 1 in this episode."""

    @abc.abstractmethod
    def key_points(self) -> np.ndarray:
        """Points (n, 3) [m] of the object that the reduced state lists."""

    def resize(self, variation: int) -> bool:
        """Fits the model to a variation; True when it changed and must be recompiled."""
        return False

    # ------------------------------------------------------------------ episode

    @property
    def variation(self) -> int:
        """Index of the current variation."""
        return self._variation

    def choose_variation(self, variation: int) -> bool:
        """Sets the variation of the next episode; True when the model must be recompiled."""
        self._variation = check_variation(variation)
        return self.resize(self._variation)

    def initialize_episode(self, physics, random_state):
        self._target.set_vertices(self._store.load(self._variation))
        self._place_actor()
        self._evaluation = self.evaluate()
        self._initial_performance = self._evaluation.performance

    def _place_actor(self):
        vertices = self._target.vertices()
        x, y = (vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2
        positions = self._actor.default_positions(np.array([x, y, self._layout.reset_height]))
        self._actor.place(positions, self._layout.workspace.centred_at(x, y))

    def before_step(self, physics, action, random_state):
        pass  # The environment drives the actor; the base class would write `ctrl`.

    def after_step(self, physics, random_state):
        self._evaluation = self.evaluate()

    def action_spec(self, physics) -> specs.BoundedArray:
        return self._actor.action_spec(physics)

    def get_reward(self, physics) -> float:
        return self.last_evaluation.reward

    @property
    def last_evaluation(self) -> Evaluation:
        """Evaluation of the state after the last env step or reset."""
        if self._evaluation is None:
            raise RuntimeError("no episode has started: call reset() first")
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
            "success": bool(normalized >= self._layout.success),
            **{f"reward_{name}": value for name, value in evaluation.reward_terms.items()},
            **evaluation.measures,
            "max_edge_strain": float(np.max(self._target.edge_strain())),
            "picks_held": int(np.count_nonzero(self._actor.held >= 0)),
            "variation": self._variation,
        }

    # ------------------------------------------------------------------ observations

    def full_state(self) -> np.ndarray:
        """All vertices (x, y, z each), zeros up to `max_vertices`, then gripper centres [m]."""
        vertices = self._target.vertices().ravel()
        grippers = self._actor.positions().ravel()
        state = np.zeros(3 * self._layout.max_vertices + grippers.size)
        state[: vertices.size] = vertices
        state[3 * self._layout.max_vertices :] = grippers
        return state

    def reduced_state(self) -> np.ndarray:
        """The key points (x, y, z each), then the gripper centres [m]."""
        return np.concatenate([self.key_points().ravel(), self._actor.positions().ravel()])

    # ------------------------------------------------------------------ snapshots

    @property
    def state_layout(self) -> tuple:
        """What must agree for a state of one instance to fit into another."""
        return (
            type(self._actor).__name__,
            self._actor.num_grippers,
            self._layout.max_vertices,
            self._action_repeat,
            self._target.physical_parameters["contact"]["selfcollide"],
        )

    def get_state(self) -> dict[str, object]:
        """What the task and its actor remember and mjData does not hold."""
        return {
            "variation": self._variation,
            "initial_performance": self._initial_performance,
            "actor": self._actor.get_state(),
        }

    def set_state(self, state: dict) -> None:
        """Restores what `get_state` returned, after mjData has been restored."""
        self._initial_performance = state["initial_performance"]
        self._actor.set_state(state["actor"])
        self._evaluation = self.evaluate()
