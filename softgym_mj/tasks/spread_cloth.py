"""SpreadCloth (SoftGym: ClothFlatten): spread a crumpled cloth on the floor.

Goal: cover as much floor as possible. Two pickers; 100 env steps of 8 sim steps.

Reward = performance: covered area in top view [m^2].
Bounds: lower = area at reset; upper = area of the flat cloth, (dimx - 1)(dimy - 1) rho^2, measured
by the same rule as the value, so that a flat cloth scores 1 in every orientation. SoftGym's bound
has half a particle of border on every side, which its value leaves out of a cloth that lies along
the axes (facts 5, row 35).
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: sizes of 60..119 particles a side; lifted 0.5..1 m at a random vertex and dropped.
Pickers start 0.2 m above the centre of the cloth's bounding box, higher where a pile is as high:
ours are higher than SoftGym's. End: horizon only.
"""

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
    """See the module docstring."""

    summary = "Spread a crumpled cloth on the floor."
    difficulty, material = "medium", "cloth"
    success = 0.9  # Ours: a spread cloth with a few flat wrinkles or one small tucked corner.
    workspace = Workspace((-0.7, -0.4, 0.0), (0.7, 0.4, 0.5))  # Facts 2.2.
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
