"""`Task`: objects in a scene, an actor and a start; how an episode begins, steps and ends."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from dm_control import composer
from dm_env import specs

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, SoftGymError
from softgym_mj.fluid import Water
from softgym_mj.metrics import Measures
from softgym_mj.rendering.look import FAST, find_look
from softgym_mj.robots.base import SIM_STEP, Actor
from softgym_mj.robots.cup_mover import CupTool
from softgym_mj.tasks.shared import actors, checks
from softgym_mj.tasks.shared.definition import Definition
from softgym_mj.tasks.shared.driving import Driving
from softgym_mj.tasks.shared.observations import (
    DEFAULT_IMAGE_SIZE,
    STATES,
    make_observables,
    warn_of_hidden_goal,
)
from softgym_mj.tasks.shared.scene import Scene
from softgym_mj.tasks.shared.state import Episode, Named, State
from softgym_mj.validation import check_type
from softgym_mj.variations.indices import SPLITS, Start, check_variation, generator
from softgym_mj.variations.randomization import DomainRandomization
from softgym_mj.variations.store import VariationStore


class Task(Definition):
    """A task: objects (rope, cloth, garment, water, cups), an actor and a goal.

    `Definition` is the interface that a subclass implements. This class runs it as a task of
    dm_control's composer: scene, episodes, steps, info and snapshots.

    Attributes:
        actor: the actor.
        scene: the scene with all objects.
        flexes: vertices of all flexes, numbered consecutively: what grippers can hold.
        objects: objects that deform or flow, then the cups, starting with the actor's.
        start: source of initial states; None if `arrange` makes them.
        store: storage of initial states; None alike.
        domain: domain randomization.
        random: generator of the environment, from which dm_control's wrappers draw.
        counts_intersections: whether info has the number of self-intersections.
        goal_marks: whether colored images show the marks of the goal.
        arguments: further arguments, as text, that must agree for a snapshot to fit.
    """

    def __init__(
        self,
        objects: Sequence[Flex | Water | Cup],
        start: Start | None = None,
        *,
        tool: CupTool | None = None,
        marks: Sequence[composer.Entity] = (),
        timestep: float | None = None,
        actor: str | Actor | None = None,
        observation: str | Sequence[str] = "reduced",
        image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
        goal_marks: bool | None = None,
        look: str = FAST.name,
        action_repeat: int | None = None,
        domain: str | Mapping[str, object] = "nominal",
        count_intersections: bool = False,
        **actor_settings: Any,
    ):
        """Puts the objects and the actor into an arena.

        Args:
            objects: objects that deform or flow, then cups that stand still; with different model
                names, not yet attached.
            start: initial states of the first object; None if `arrange` places all of them.
            tool: cup for the actor to move; None for grippers.
            marks: entities that mark the goal by sites; observed images show them if `goal_marks`.
            timestep: physics step [s], a sim step divided by a whole number; by default the largest
                that suits all objects.
            actor, observation, image_size, goal_marks, look, action_repeat, domain,
                count_intersections: as in `ClothTaskSettings`. With several objects, domain
                parameters are prefixed by the object's model name: "rope_friction".
            **actor_settings: `num_pickers`, `arms`, `grasp`, `visual` and `action`, also as in
                `ClothTaskSettings`.

        Raises:
            InvalidArgumentError: for an argument of a wrong type, a bad name or number.
        """
        checks.check_objects(objects, tool is not None)
        checks.check_workspace(self.workspace)
        check_type("success", self.success, float)
        checks.check_symmetries(self.symmetries)
        if start is None and type(self).arrange is Task.arrange:
            raise InvalidArgumentError("start", start, "a Start, or a method `arrange` of the task")
        self.start = start
        self.store = None if start is None else VariationStore(start)
        self.actor = actors.make(type(self), actor, tool, actor_settings)
        held = () if tool is None else (tool.cup,)
        self.scene = Scene(objects, self.actor, held, self.view, marks, find_look(look))
        self.flexes, self.objects = self.scene.flexes, self.scene.objects
        self.counts_intersections = count_intersections
        self.domain = DomainRandomization(domain, self.scene.adjustable)
        counts = sum(thing.num_points for thing in self.scene.materials.values())
        self.max_points = counts if start is None else start.max_points
        usual = type(self).action_repeat
        self.action_repeat = actors.checked_repeat(self.actor, action_repeat, usual)
        self.set_timesteps(
            control_timestep=self.action_repeat * SIM_STEP,
            physics_timestep=checks.checked_timestep(timestep, self.scene.materials.values()),
        )
        if goal_marks and not marks:
            raise InvalidArgumentError("goal_marks", goal_marks, "False: this task draws no goal")
        self.goal_marks = bool(marks) and self.hidden_goal if goal_marks is None else goal_marks
        self._observables = make_observables(self, observation, image_size, self.goal_marks)
        if self.hidden_goal:
            warn_of_hidden_goal(self._observables, self.goal_marks)
        self._variation, self._chosen = 0, False
        self._episode: Episode | None = None
        self._stored: dict[str, np.ndarray] = {}
        self._evaluated: tuple[State, Measures] | None = None  # The last state, and its measures.
        self._named = False  # Whether names in info have been checked.
        self.arguments: dict[str, str] = {}

    @property
    def root_entity(self) -> Arena:
        if "scene" not in vars(self):
            raise SoftGymError("the scene does not exist yet: call super().__init__ first")
        return self.scene.arena

    @property
    def task_observables(self):
        return self._observables

    @property
    def visualize_reward(self) -> bool:
        """Always False: dm_control's coloring by reward is not supported."""
        return False

    @visualize_reward.setter
    def visualize_reward(self, value: bool) -> None:
        if value is not False:
            raise InvalidArgumentError("visualize_reward", value, "False")

    @property
    def variation(self) -> int:
        """Index of the current variation."""
        return self._variation

    def choose_variation(self, variation: int) -> bool:
        """Sets the variation of the next episode; returns True if the model must be recompiled."""
        self._variation, self._chosen = check_variation(variation), True
        resized = self.resize(self._variation)
        if not isinstance(resized, (bool, np.bool_)):
            raise InvalidArgumentError("resize()", resized, "True if the model changed, else False")
        return self.domain.apply(self._variation) or resized

    def after_compile(self, physics, random_state):
        self.random = random_state
        self._episode, self._stored = None, {}  # Sizes have changed.
        self.scene.compiled(physics)
        physics.legacy_step = False  # Holding sets velocities before a whole step.

    def points(self) -> np.ndarray:
        """Returns all points (n, 3) [m] of objects that deform or flow."""
        return np.concatenate(list(self.scene.points().values()))

    def _new_episode(self, points: dict[str, np.ndarray]) -> Episode:
        # Stored points: those read back from the model differ in the last bit.
        points = Named("episode.points", {**points, **self._stored})
        shapes = Named("episode.shapes", self.scene.shapes())
        goal = Named("episode.goal", self.goal(self._variation, points))
        return Episode(self._variation, points, shapes, goal, 0.0)

    def initialize_episode(self, physics, random_state):
        self.arrange(generator(type(self).__name__, self._variation))
        points = self.scene.points()
        checks.check_points(points, self.scene.arena)
        self.actor.begin(self.tool_start(points), self.flexes.points())
        self._episode = self._new_episode(points)
        checks.check_goal(self._episode.goal)
        self.draw_goal(self._episode.goal)
        self.scene.note_strain(starts=True)
        self._evaluate()
        initial = self.last_evaluation.performance
        self._episode = dataclasses.replace(self._episode, initial_performance=initial)
        checks.check_bounds(self.bounds(self._episode))
        if not self._named:
            checks.check_task(self)
            self._named = True

    def state(self) -> State:
        """Returns the current state."""
        return self.scene.state()

    def observe(self, name: str) -> np.ndarray:
        """Returns an observation (n,) of the current state, one of `observations.STATES`."""
        return STATES[name].value(self, self.state(), self.episode)

    def _evaluate(self) -> None:
        state = self.state()
        self._evaluated = state, checks.checked(self.measure(state, self.episode))

    def initialize_episode_mjcf(self, random_state):
        if not self._chosen:  # As in composer's own Environment, which chooses none.
            self.choose_variation(int(random_state.choice(SPLITS["train"])))
        self._chosen = False

    def set_timesteps(self, control_timestep: float, physics_timestep: float) -> None:
        super().set_timesteps(control_timestep, physics_timestep)
        self._driving = Driving(self.actor, physics_timestep)

    def before_step(self, physics, action, random_state):
        self._driving.start(action, self.driven)

    def before_substep(self, physics, action, random_state):
        self._driving.substep()

    def after_step(self, physics, random_state):
        self.scene.check_finite()
        self.scene.note_strain()
        self._evaluate()

    def action_spec(self, physics) -> specs.BoundedArray:
        return self.actor.action_spec(physics)

    def get_reward(self, physics) -> float:
        return self.last_evaluation.reward

    @property
    def episode(self) -> Episode:
        """Constants of the current episode; before the first, those of the model as compiled."""
        if self._episode is None:
            self._episode = self._new_episode(self.scene.points())
        return self._episode

    def _last(self) -> tuple[State, Measures]:
        if self._evaluated is None:
            raise LifecycleError("no episode has started: call reset() first")
        return self._evaluated

    @property
    def last_evaluation(self) -> Measures:
        """Measures of the state after the last env step or reset."""
        return self._last()[1]

    def info(self) -> dict[str, np.generic]:
        """Returns NumPy scalars of the last evaluation; "reward_*" entries add up to the reward."""
        state, measures = self._last()
        info = {
            **self.describe(state, self.episode, measures),
            **self.diagnostics(),
            **self.actor.diagnostics(),
            **{f"domain_{name}": self.domain.values[name] for name in self.domain.varying},
            "variation": self._variation,
        }
        return {name: np.asarray(value).flat[0] for name, value in info.items()}

    @property
    def last_secondary_metrics(self) -> dict[str, float]:
        """Secondary metrics of the state after the last env step or reset."""
        state, measures = self._last()
        metrics = self.secondary_metrics(state, self.episode, measures)
        return {name: float(value) for name, value in metrics.items()}

    @property
    def snapshot_key(self) -> dict[str, object]:
        """Settings that must agree for a state of one instance to fit another."""
        return {
            "actor": self.actor.name,
            "action size": self.actor.action_size,
            "objects": tuple(self.scene.materials),
            "most points (fidelity)": self.max_points,
            "action repeat": self.action_repeat,
            "domain": {name: self.domain.ranges[name] for name in self.domain.varying},
            **({"arguments": self.arguments} if self.arguments else {}),
        }

    def get_state(self) -> dict[str, object]:
        """Returns the state of the task and its actor that mjData does not hold.

        A task with state of its own, such as a counter that `after_step` changes, adds it, so that
        snapshots stay exact:

            def get_state(self):
                return {**super().get_state(), "count": self.count}

            def set_state(self, state):
                self.count = state["count"]
                super().set_state(state)  # Measures, so it comes last.
        """
        return {
            "variation": self._variation,
            "initial_performance": self.episode.initial_performance,
            "most_strained": self.scene.most_strained,
            "actor": self.actor.get_state(),
        }

    def set_state(self, state: dict) -> None:
        """Restores what `get_state` returned, after mjData has been restored, and measures."""
        initial = state["initial_performance"]
        self._episode = dataclasses.replace(self.episode, initial_performance=initial)
        self.scene.note_strain()
        self.scene.most_strained = state["most_strained"]
        self.actor.set_state(state["actor"])
        self._evaluate()
