"""The task StraightenRope (SoftGym: RopeFlatten)."""

from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.rope import LENGTH, Rope
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared import secondary_metrics
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries, points
from softgym_mj.tasks.shared.settings import TaskSettings
from softgym_mj.tasks.shared.starts.twisted_rope import TwistedRope
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere


class StraightenRope(Task):
    """Pull the ends of a twisted rope apart until it is straight.

    Goal: the two ends 0.5 m apart, the natural length.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists 10 key points, evenly spaced along the rope, and picker
    0, picker 1 (x, y, z each): 36 entries [m]. `OBSERVATIONS` of
    `tasks.shared.observations` lists the others.
    Reward = performance: -|d - 0.5|, with the distance d of the end vertices [m].
    Bounds: lower = -0.5 (the worst possible, not the start), upper = 0. The start scores well above
    0: `initial_normalized_performance` in info.
    Horizon: 75 env steps of 8 sim steps; nothing else ends an episode.
    Start: the rope is dragged four times by a random vertex (docs/softgym.md 3.4); the two pickers
    start 0.1 m above the floor around the center of its bounding box. In 37 of the 1000 variations,
    8 of the 200 of `evaluate`, the ends are 0.5 m apart by chance, so the start counts as success
    whatever the shape of the rope: a policy that does nothing solves these.
    """

    summary = "Pull the ends of a twisted rope apart until it is straight."
    difficulty, material = "medium", "rope"
    horizon = 75  # docs/softgym.md 1.2.
    success = 0.95  # Our choice: ends within 2.5 cm of the natural length.
    workspace = Workspace((-0.35, -0.35, 0.0), (0.35, 0.35, 0.3))  # docs/softgym.md 2.2.
    reset_height, view = 0.1, "straighten_rope"
    example_variation, softgym_name = 814, "RopeFlatten"
    symmetries = anywhere("same", "reversed")

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[TaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the rope: "fast", "default" or "accurate".
            **settings: entries of `TaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        self.rope = Rope(fidelity)
        super().__init__([self.rope], TwistedRope(fidelity), **settings)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return ToolStart.over(points["rope"], self.reset_height, self.workspace)

    def measure(self, state: State, episode: Episode) -> Measures:
        points = state.points["rope"]
        distance = metrics.distance(points[..., 0, :], points[..., -1, :])
        performance = -abs(distance - LENGTH)
        return Measures(
            performance,
            rewards={"end_distance_error": performance},
            info={"end_point_distance": distance},
        )

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return -LENGTH, 0.0

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        points = state.points["rope"]
        return secondary_metrics.point_error(points, secondary_metrics.straight(points, LENGTH))

    def reduced(self, state: State, episode: Episode) -> Entries:
        keys = self.rope.key_points
        found = metrics.chosen(state.points["rope"], keys)
        return {f"{len(keys)} key points": points(found, "object")}

    def episode_info(self, episode: Episode) -> dict[str, Array]:
        initial = metrics.normalize(episode.initial_performance, *self.bounds(episode))
        return {"initial_normalized_performance": initial}
