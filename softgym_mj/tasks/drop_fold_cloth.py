"""DropFoldCloth (SoftGym: ClothFoldDrop): drop a hanging cloth so that it lies folded in half.

Goal: the second half of the columns of SoftGym's particles at x = i rho for column i, the rows
centred about Y = 0, and columns 0 to half on top of their mirror columns. Two pickers that cannot
get lower than 0.55 m, so that the cloth has to be swung; 100 env steps of 8 sim steps.

Reward = performance: -(mean distance of the pairs) - 1.2 (mean distance of the second half from its
place) [m]; SoftGym takes the hanging cloth for its place, which the words of the paper contradict.
Bounds: lower = at reset, upper = 0. Distances alone count: a heap in the right place scores 0.7,
which `outline_iou` and `wrinkle_height` in info tell from a fold.
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: the cloth hangs by the corners p1, p2 of column 0, which picker 0 and picker 1 hold from 5 cm
above: an action with grip <= 0 lets go. Sizes of 60..119 particles a side.
End: horizon only.
"""

from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.marks import OUTLINE_WIDTH, GoalLine
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import ToolStart
from softgym_mj.tasks.shared import entries, hanging, quality
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import HangingCloth
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import mirrored


class DropFoldCloth(Task):
    """See the module docstring."""

    summary = "Drop a hanging cloth so that it lies folded in half."
    difficulty, material = "hard", "cloth"
    success = 0.85  # Ours: folded with some wrinkles; a heap in the right place scores 0.7.
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
        self.cloth = Cloth(fidelity=fidelity)
        self._outline = GoalLine(5, OUTLINE_WIDTH)
        super().__init__([self.cloth], HangingCloth(fidelity), marks=[self._outline], **settings)
        hanging.check_grippers(self.actor)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return hanging.held_by_corners(self.cloth)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """SoftGym's particles (dimy, dimx, 3) [m] of the cloth in its place, and its outline."""
        particles = hanging.laid_down(self.cloth)
        return {"particles": particles, "outline": quality.outline(particles, folded=True)}

    def show(self, goal: dict[str, np.ndarray]) -> None:
        self._outline.draw(goal["outline"][quality.AROUND, :2])

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        return metrics.fold(shape, state.points["cloth"], goal)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def quality(self, state: State, episode: Episode, measures: Measures) -> dict[str, Array]:
        return quality.laying(state, episode, folded=True)

    def reduced(self, state: State, episode: Episode) -> Entries:
        return entries.corners(state, episode)
