"""`Definition`: what the author of a task says, in class data and methods."""

import abc
from typing import ClassVar

import numpy as np
from dm_control import composer
from dm_control.composer.observation import observable

from softgym_mj import metrics
from softgym_mj.entities.views import View
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.factory import GRIPPERS
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.entries import Entries, point
from softgym_mj.tasks.shared.goals import Goals
from softgym_mj.tasks.shared.scene import Scene
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import Turned
from softgym_mj.variations.indices import Start
from softgym_mj.variations.store import VariationStore


class Definition(composer.Task, abc.ABC):
    """What kind of task it is, and what is measured.

    A subclass of `Task` says in its class data what kind of task it is, builds its objects in
    `__init__`, and defines `measure`; `arrange` too, unless it has a `Start`. `measure`, `bounds`,
    `reduced` and `extra_state` are functions of arrays, of one simulation or of many.

    Attributes:
        summary: what is to be done.
        difficulty, material: words to find it by; the material is also what pickers are made for:
            "cloth" or "rope".
        horizon: env steps in an episode.
        action_repeat: sim steps of 0.01 s per env step.
        success: normalised performance from which the goal counts as reached.
        actors: names of those that it can have, the usual one first.
        workspace: of grippers.
        reset_height: of grippers at the start [m], or of a cup.
        arm_height: of the bases of arms above the floor [m].
        view: from where it is looked at, or its name in `views.VIEWS`.
        planning_horizon: env steps that planners look ahead; the shipped ones are the paper's table
            and, for hard tasks, the authors' code.
        example_variation: the one that shows it best.
        softgym_name: what SoftGym calls it.
        hidden_goal: whether the goal depends on the variation and nothing in images without marks
            shows it.
        goals: functions of a goal that is drawn in each variation, for hindsight; None for others.
        symmetries: turns of the world and orders of points that leave the task as it is; a policy
            can learn from each step in all of them. None by default.
        driven: whether an `Environment` makes as many sim steps as an action takes.
    """

    summary = ""
    difficulty, material = "custom", "cloth"
    horizon, action_repeat = 100, 8
    success = 0.9
    actors: ClassVar[tuple[str, ...]] = GRIPPERS
    workspace = Workspace((-0.7, -0.6, 0.0), (0.7, 0.6, 0.6))
    reset_height, arm_height = 0.3, 0.0
    view: View | str = "cloth"
    planning_horizon, example_variation = 15, 806
    softgym_name: str | None = None
    hidden_goal = driven = False
    goals: ClassVar[type[Goals] | None] = None
    symmetries: ClassVar[tuple[Turned, ...]] = ()
    # What `Task` makes of its arguments.
    scene: Scene
    start: Start | None
    store: VariationStore | None
    counts_intersections: bool
    _variation: int
    _stored: dict[str, np.ndarray]

    def arrange(self, random: np.random.Generator) -> None:
        """Places the objects where an episode starts: finite, and not below the floor.

        By default the first object gets the points as stored.

        Args:
            random: the generator of the current variation: the same for the same index and name
                of the class. A subclass, or a class with another name, starts elsewhere.
        """
        assert self.store is not None, "checked by the constructor"
        name, thing = next(iter(self.scene.materials.items()))
        self._stored = {name: self.store.load(self._variation)}
        thing.set_points(self._stored[name])

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        """Where the actor starts: unless a task says otherwise above the origin.

        Args:
            points: (n, 3) [m] of each object at the start, by name.
        """
        return ToolStart((0.0, 0.0, self.reset_height), self.workspace)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """What an episode's measures compare with: arrays by name.

        Args:
            variation: index.
            points: (n, 3) [m] of each object at the start, by name.
        """
        return {}

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        """Draws the goal of an episode that starts."""

    @abc.abstractmethod
    def measure(self, state: State, episode: Episode) -> Measures:
        """Measures a state and changes nothing: `set_state` calls it once more.

        The tasks of the package are functions of these arrays alone, of one simulation or of many.
        """

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        """(lower, upper) performance (...) that normalise to 0 and 1 in an episode, lower < upper.

        Unless a task says otherwise its performance is from 0 to 1 by itself.
        """
        return 0.0, 1.0

    def reduced(self, state: State, episode: Episode) -> Entries:
        """The few numbers that describe the state, by what they are called.

        What the actor senses of itself follows by itself. Unless a task says otherwise they are
        the middle of every object.
        """
        return {
            f"middle of the {name}": point(points.mean(axis=-2))
            for name, points in state.points.items()
        }

    def extra_state(self, state: State, episode: Episode) -> Entries:
        """What the full state lists between the points and what the actor senses, as `reduced`."""
        return {}

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        """Further scalars (...) for info and results, as other work has them; only read there."""
        return {}

    def episode_info(self, episode: Episode) -> dict[str, Array]:
        """Further scalars (...) for info that say how an episode has started."""
        return {}

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        """Further observables by name, with images of height x width pixels."""
        return {}

    def resize(self, variation: int) -> bool:
        """Fits the model to a variation; returns True when it changed and must be recompiled."""
        sizes = () if self.start is None else self.start.sizes(variation)
        return self.scene.resize(sizes)

    def diagnostics(self) -> dict[str, float | int]:
        """Further scalars for info."""
        return self.scene.diagnostics(self.counts_intersections)

    def describe(self, state: State, episode: Episode, measures: Measures) -> dict[str, Array]:
        """What info says of a state by its points alone: (...) by name."""
        normalized = metrics.normalize(measures.performance, *self.bounds(episode))
        success = normalized >= self.success
        return {
            "performance": measures.performance,
            "normalized_performance": normalized,
            "success": success,
            "is_success": success,  # Its name in Stable-Baselines3 and Gymnasium-Robotics.
            **{f"reward_{name}": value for name, value in measures.rewards.items()},
            **measures.info,
            **self.secondary_metrics(state, episode, measures),
            **self.episode_info(episode),
        }
