"""`Definition`: class attributes and methods by which a task is defined."""

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
    """Interface by which a task is defined.

    A subclass of `Task` sets class attributes, builds its objects in `__init__`, and defines
    `measure`, and also `arrange` unless it has a `Start`. `measure`, `bounds`, `reduced` and
    `extra_state` are functions of arrays, of one simulation or of a batch.

    Attributes:
        summary: what to do, in a sentence.
        difficulty, material: tags; the material ("cloth" or "rope") also selects the pickers' size.
        horizon: env steps in an episode.
        action_repeat: sim steps of 0.01 s per env step.
        success: normalized performance from which the goal counts as reached.
        actors: names of possible actors; the first is the default.
        workspace: workspace of grippers.
        reset_height: height of grippers at the start [m], or of a cup.
        arm_height: height of the bases of arms above the floor [m].
        view: camera view, or its name in `views.VIEWS`.
        planning_horizon: env steps that planners look ahead: from the paper's table or, for hard
            tasks, the authors' code.
        example_variation: variation for pictures and videos.
        softgym_name: the task's name in SoftGym.
        hidden_goal: whether the goal depends on the variation and images show it by marks only;
            they then have marks by default.
        goals: `Goals` of a task whose goal is drawn in each variation; else None.
        symmetries: rotations of the world and orders of points that leave the task unchanged;
            learners can augment each step by them.
        driven: whether an `Environment` simulates as many sim steps as an action takes.
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
    # `Task` sets these from its arguments.
    scene: Scene
    start: Start | None
    store: VariationStore | None
    counts_intersections: bool
    _variation: int
    _stored: dict[str, np.ndarray]

    def arrange(self, random: np.random.Generator) -> None:
        """Places the objects where an episode starts: finite, and not below the floor.

        By default the first object gets its stored points.

        Args:
            random: generator of the current variation: the same for the same index and class name,
                so a subclass starts elsewhere.
        """
        assert self.store is not None, "checked by the constructor"
        name, thing = next(iter(self.scene.materials.items()))
        self._stored = {name: self.store.load(self._variation)}
        thing.set_points(self._stored[name])

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        """Returns where the actor starts; by default above the origin.

        Args:
            points: (n, 3) [m] of each object at the start, by name.
        """
        return ToolStart((0.0, 0.0, self.reset_height), self.workspace)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns the goal of an episode: arrays by name.

        Args:
            variation: index.
            points: (n, 3) [m] of each object at the start, by name.
        """
        return {}

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        """Draws the marks of the goal at the start of an episode."""

    @abc.abstractmethod
    def measure(self, state: State, episode: Episode) -> Measures:
        """Measures a state without changing anything: `set_state` calls it again.

        Tasks of the package compute it from these arrays alone, of one simulation or of a batch.
        """

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        """Returns (lower, upper) performance (...) that normalize to 0 and 1, with lower < upper.

        By default the performance is already in 0 to 1.
        """
        return 0.0, 1.0

    def reduced(self, state: State, episode: Episode) -> Entries:
        """Returns the reduced state: a few numbers by name.

        The actor's proprioception is appended. By default it has the middle of every object.
        """
        return {
            f"middle of the {name}": point(points.mean(axis=-2))
            for name, points in state.points.items()
        }

    def key_points(self, state: State, episode: Episode) -> Entries:
        """Returns as many numbers in every variation that describe the object's shape.

        By default they are those of `reduced`; corners do not describe the shape of a cloth.
        """
        return self.reduced(state, episode)

    def extra_state(self, state: State, episode: Episode) -> Entries:
        """Returns what the full state lists after the points, by name as in `reduced`."""
        return {}

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        """Returns further scalars (...) for info and results, as other work defines them."""
        return {}

    def episode_info(self, episode: Episode) -> dict[str, Array]:
        """Returns further scalars (...) for info that describe the start of an episode."""
        return {}

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        """Returns further observables by name, with images of height x width pixels."""
        return {}

    def resize(self, variation: int) -> bool:
        """Fits the model to a variation; returns True if it changed and must be recompiled."""
        sizes = () if self.start is None else self.start.sizes(variation)
        return self.scene.resize(sizes)

    def diagnostics(self) -> dict[str, float | int]:
        """Returns further scalars for info."""
        return self.scene.diagnostics(self.counts_intersections)

    def describe(self, state: State, episode: Episode, measures: Measures) -> dict[str, Array]:
        """Returns the part of info that follows from states: scalars (...) by name."""
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
