"""The task FoldCloth (SoftGym: ClothFold)."""

from typing import Unpack

import numpy as np

from softgym_mj.entities.cloth import Cloth
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.laid_cloth import LaidCloth
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import FlatCloth
from softgym_mj.tasks.shared.symmetry import anywhere


class FoldCloth(LaidCloth):
    """Fold a flat cloth in half.

    Goal: the half of the cloth near the pickers (the first half of its columns, from -X) lies on
    the other half, each particle on its mirror image; the other half has not moved. A strip in
    the color of the cloth's other side marks the half to fold.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4 and picker 0, picker 1 (x, y, z
    each): 18 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the mirror pairs) - 1.2 (mean distance of the other
    half from its place) [m], over SoftGym's particles.
    Bounds: lower = performance at reset, upper = 0. The two layers lie 1 cm apart, so a perfect
    fold scores 0.95 to 0.97.
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the cloth lies flat, rotated by up to 45 degrees, with sides of 60 to 119 particles; the
    two pickers start 0.1 m above the middle of column 0. The workspace reaches 0.8 m from there
    along X and Y; SoftGym's is too small for 73 % of the folds (docs/softgym.md 5, row 25).
    """

    summary = "Fold a flat cloth in half."
    difficulty, material = "medium", "cloth"
    success = 0.85  # Our choice: a mean distance of 4 cm for a cloth of 0.5 m.
    workspace = Workspace((-0.85, -0.85, 0.0), (0.85, 0.85, 0.5))
    reset_height, view = 0.1, "fold_cloth"
    planning_horizon, softgym_name = 30, "ClothFold"  # From the paper; SoftGym's code has 15.
    symmetries = anywhere("same", "rows")  # The task depends on which half is folded over.

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[ClothTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        cloth = Cloth(fidelity=fidelity, marker=True)
        super().__init__(cloth, FlatCloth(fidelity), **settings)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        column = points["cloth"][self.cloth.corners[:2]]
        return ToolStart.over(column, self.reset_height, self.workspace)

    def place(self, points: np.ndarray) -> np.ndarray:
        return self.cloth.particles(points)
