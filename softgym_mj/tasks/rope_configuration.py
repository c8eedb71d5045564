"""The task RopeConfiguration."""

from typing import Unpack

import numpy as np
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj import metrics
from softgym_mj.entities.marks import GoalLine
from softgym_mj.entities.rope import Rope
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array, Measures, namespace
from softgym_mj.rendering.observables import CameraObservable
from softgym_mj.rendering.offscreen import CameraView, refresh_poses
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared import secondary_metrics
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries, points
from softgym_mj.tasks.shared.goals import Goals
from softgym_mj.tasks.shared.letters import LETTERS, letter
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE, GOAL_RGB
from softgym_mj.tasks.shared.settings import TaskSettings
from softgym_mj.tasks.shared.starts.twisted_rope import TwistedRope
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere
from softgym_mj.variations.indices import generator

HIDDEN_GROUP = 5  # Geom group that is not rendered: the actor's in the goal image.
MATCHINGS = ("key_points", "vertices")


def goal_name(variation: int) -> str:
    """Returns the letter of a variation, drawn uniformly."""
    return LETTERS[int(generator("rope_configuration", variation).integers(len(LETTERS)))]


class RopeGoals(Goals):
    """Goal positions of the vertices, in either direction: k = 3 n [m]."""

    def achieved(self, state: State, episode: Episode) -> Array:
        return metrics.flat(state.points["rope"])

    def desired(self, state: State, episode: Episode) -> Array:
        return metrics.flat(episode.goal["rope"])

    def reward(self, achieved: Array, desired: Array) -> Array:
        none = achieved[..., :0]
        shape = (*achieved.shape[:-1], achieved.shape[-1] // 3, 3)
        points, places = achieved.reshape(shape), desired.reshape(shape)
        there = namespace(points).ones_like(points[..., 0]) > 0
        state = State({"rope": points}, {"rope": there}, {}, none, none)
        episode = Episode(0, {}, {"rope": {}}, {"rope": places}, 0.0)
        return self.task.measure(state, episode).reward


class RopeConfiguration(Task):
    """Lay a twisted rope in the shape of a letter.

    Goal: the rope on the letter S, O, M, C or U that is drawn on the floor about the origin, in
    either direction.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists 10 key points of the rope, 10 of the goal, evenly
    spaced, and picker 0, picker 1 (x, y, z each): 66 entries [m]. `full` lists all vertices, those
    of the goal and the pickers. `goal_rgb` is the task camera's image with the rope on the letter;
    other images show the letter unless `goal_marks=False`.
    `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the 10 key points from those of the goal, matched to
    minimize it) [m]; of all vertices with `matching="vertices"`.
    Bounds: lower = performance at reset, upper = 0. The goal has the rope's length and rests on the
    floor, so it can be reached; SoftGym's hovers at 5 cm (docs/softgym.md 5, rows 19 and 20).
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: as in StraightenRope: the rope is dragged four times by a random vertex, and the two
    pickers start 0.1 m above the floor around the center of its bounding box.
    """

    summary = "Lay a rope in the shape of a letter."
    difficulty, material = "hard", "rope"
    success = 0.8  # Our choice: key points within 0.6 to 2.2 cm of the letter on average.
    workspace = Workspace((-0.35, -0.35, 0.0), (0.35, 0.35, 0.3))  # docs/softgym.md 2.2.
    reset_height, view = 0.1, "rope_configuration"
    softgym_name, hidden_goal = "RopeConfiguration", True
    goals = RopeGoals
    symmetries = anywhere("same", "reversed")  # The goal turns with the rope.

    def __init__(
        self,
        *,
        fidelity: str = "default",
        matching: str = "key_points",
        **settings: Unpack[TaskSettings],
    ):
        """Builds the task.

        Args:
            fidelity: resolution of the rope: "fast", "default" or "accurate".
            matching: what the reward matches: 10 "key_points" or all "vertices".
            **settings: entries of `TaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        check_name("matching", matching, MATCHINGS)
        self.rope = rope = Rope(fidelity)
        self._line = GoalLine(rope.num_points)
        every = np.arange(rope.num_points)
        self._matched = rope.key_points if matching == "key_points" else every
        self._goal_rgb: np.ndarray | None = None
        super().__init__([rope], TwistedRope(fidelity), marks=[self._line], **settings)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return ToolStart.over(points["rope"], self.reset_height, self.workspace)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns the goal positions "rope" (n, 3) [m] of the vertices, in either direction."""
        places = letter(goal_name(variation), self.rope.num_points)
        return {"rope": np.column_stack([places, np.full(len(places), self.rope.radius)])}

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        self._goal_rgb = None
        self._line.draw(goal["rope"][:, :2])

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        seen = specs.BoundedArray((height, width, 3), np.uint8, 0, 255)
        return {
            GOAL_RGB: CameraObservable(
                [CameraView("task", height, width)],
                lambda physics: self._shown_goal(physics, height, width),
                seen,
            )
        }

    def _shown_goal(self, physics, height: int, width: int) -> np.ndarray:
        """Returns the goal image of the episode, rendered once."""
        if self._goal_rgb is None:
            self._goal_rgb = self.goal_image(physics, height, width)
        return self._goal_rgb.copy()

    def goal_image(
        self, physics, height: int = DEFAULT_IMAGE_SIZE[0], width: int = DEFAULT_IMAGE_SIZE[1]
    ) -> np.ndarray:
        """Returns the task camera's image (height, width, 3) uint8 with the rope at its goal.

        The actor is hidden. Nothing is simulated, and the state does not change.
        """
        model, data = physics.model.ptr, physics.data.ptr
        qpos, qvel, groups = data.qpos.copy(), data.qvel.copy(), model.geom_group.copy()
        for geom in range(model.ngeom):
            if model.geom(geom).name.split("/")[0] in self.actor.model_names:
                model.geom_group[geom] = HIDDEN_GROUP
        self.rope.set_points(self.episode.goal["rope"])
        image = CameraView("task", height, width, marks=False).rgb(physics)
        data.qpos[:], data.qvel[:], model.geom_group[:] = qpos, qvel, groups
        refresh_poses(physics)
        return image

    def measure(self, state: State, episode: Episode) -> Measures:
        points, goal = state.points["rope"], episode.goal["rope"]
        matched = (metrics.chosen(places, self._matched) for places in (points, goal))
        performance = -metrics.matched_distance(*matched)
        return Measures(performance, rewards={"matched_distance": performance})

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        return secondary_metrics.point_error(state.points["rope"], episode.goal["rope"])

    def reduced(self, state: State, episode: Episode) -> Entries:
        keys = self.rope.key_points
        rope, goal = (metrics.chosen(where["rope"], keys) for where in (state.points, episode.goal))
        return {
            f"{len(keys)} key points of the rope": points(rope, "object"),
            f"{len(keys)} key points of the goal": points(goal, "goal"),
        }

    def extra_state(self, state: State, episode: Episode) -> Entries:
        goal = episode.goal["rope"]
        return {f"{goal.shape[-2]} vertices of the goal": points(goal, "goal")}
