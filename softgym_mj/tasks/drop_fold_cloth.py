"""DropFoldCloth (SoftGym: ClothFoldDrop): drop a hanging cloth so that it lies folded in half.

Goal: the second half of the columns of SoftGym's particles at x = i rho for column i, the rows
centred about Y = 0, and columns 0 to half on top of their mirror columns. Two pickers that cannot
get lower than 0.55 m, so that the cloth has to be swung; 100 env steps of 8 sim steps.

Reward = performance: -(mean distance of the pairs) - 1.2 (mean distance of the second half from its
place) [m]; SoftGym takes the hanging cloth for its place, which the words of the paper contradict.
Bounds: lower = at reset, upper = 0. Distances alone count: a pile in the right place scores 0.7,
which `outline_iou` and `wrinkle_height` in info tell from a fold.
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: the cloth hangs by the corners p1, p2 of column 0, which picker 0 and picker 1 hold from 5 cm
above: an action with grip <= 0 lets go. Sizes of 60..119 particles a side.
End: horizon only.
"""

from typing import Unpack

import numpy as np

from softgym_mj.entities.cloth import Cloth
from softgym_mj.robots.workspace import ToolStart
from softgym_mj.tasks.shared import hanging
from softgym_mj.tasks.shared.laid_cloth import LaidCloth
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import HangingCloth
from softgym_mj.tasks.shared.symmetry import mirrored


class DropFoldCloth(LaidCloth):
    """See the module docstring."""

    summary = "Drop a hanging cloth so that it lies folded in half."
    difficulty, material = "hard", "cloth"
    success = 0.85  # Ours: folded with some wrinkles; a pile in the right place scores 0.7.
    actors, workspace = hanging.ACTORS, hanging.WORKSPACE
    arm_height, view = hanging.BASE_HEIGHT, "drop_fold_cloth"
    planning_horizon, example_variation, softgym_name = 30, 953, "ClothFoldDrop"
    symmetries = mirrored("rows")

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[ClothTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        cloth = Cloth(fidelity=fidelity)
        super().__init__(cloth, HangingCloth(fidelity), **settings)
        hanging.check_grippers(self.actor)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return hanging.held_by_corners(self.cloth)

    def place(self, points: np.ndarray) -> np.ndarray:
        return hanging.laid_down(self.cloth)
