"""The task SpreadCloth (SoftGym: ClothFlatten)."""

from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared import entries, secondary_metrics
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import CrumpledCloth
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere


class SpreadCloth(Task):
    """Spread a crumpled cloth on the floor.

    Goal: the cloth covers as much floor as possible.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4 and picker 0, picker 1 (x, y, z
    each): 18 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: covered area in top view [m^2].
    Bounds: lower = area at reset; upper = area of the flat cloth, (dimx - 1)(dimy - 1) rho^2,
    measured like the performance, so a flat cloth scores 1 in every orientation. SoftGym's bound
    is half a particle larger on every side, so an axis-aligned flat cloth scores below 1 there
    (docs/softgym.md 5, row 30).
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the cloth, with sides of 60 to 119 particles, is lifted by 0.5 to 1 m at a random vertex
    and dropped. The two pickers start 0.2 m above the center of its bounding box, or higher above
    a high pile; piles are higher than SoftGym's.
    """

    summary = "Spread a crumpled cloth on the floor."
    difficulty, material = "medium", "cloth"
    success = 0.9  # Our choice: a spread cloth with a few flat wrinkles or one small tucked corner.
    workspace = Workspace((-0.7, -0.4, 0.0), (0.7, 0.4, 0.5))  # docs/softgym.md 2.2.
    reset_height, view, softgym_name = 0.2, "spread_cloth", "ClothFlatten"
    symmetries = anywhere("same", "rows", "columns", "both")

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[ClothTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        self.cloth = Cloth(fidelity=fidelity)
        super().__init__([self.cloth], CrumpledCloth(fidelity), **settings)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return ToolStart.over(points["cloth"], self.reset_height, self.workspace)

    def measure(self, state: State, episode: Episode) -> Measures:
        triangles = episode.shapes["cloth"]["triangles"]
        area = metrics.covered_area(state.points["cloth"], triangles)
        return Measures(area, rewards={"covered_area": area})

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        size = episode.shapes["cloth"]["size"]
        return episode.initial_performance, size[..., 0] * size[..., 1]

    def secondary_metrics(
        self, state: State, episode: Episode, measures: Measures
    ) -> dict[str, Array]:
        return secondary_metrics.flattening(measures.performance, *self.bounds(episode))

    def reduced(self, state: State, episode: Episode) -> Entries:
        return entries.corners(state, episode)

    def key_points(self, state: State, episode: Episode) -> Entries:
        return entries.key_points(state, episode)
