"""The task FoldCrumpledCloth (SoftGym: ClothFoldCrumpled)."""

from typing import Unpack

import numpy as np

from softgym_mj.entities.cloth import Cloth
from softgym_mj.robots.workspace import Workspace
from softgym_mj.tasks.shared.laid_cloth import LaidCloth
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import CrumpledCloth
from softgym_mj.tasks.shared.symmetry import mirrored


class FoldCrumpledCloth(LaidCloth):
    """Spread a crumpled cloth, then fold it in half.

    Goal: the first half of the cloth's columns lies on the other half, each particle on its mirror
    image; the other half lies as in a flat cloth at the origin. A strip in the color of the
    cloth's other side marks the half to fold.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4 and picker 0, picker 1 (x, y, z
    each): 18 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the mirror pairs) - 1.2 (mean distance of the second
    half from its place) [m], over SoftGym's particles.
    Bounds: lower = performance at reset, upper = 0. The two layers lie 1 cm apart, so a perfect
    fold scores 0.96 to 0.98.
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the cloth, with sides of 60 to 119 particles, is lifted and dropped as in SpreadCloth;
    the two pickers start 0.2 m above the origin, or higher above a high pile. The workspace reaches
    0.8 m from there along X and Y; SoftGym's reaches 0.65 by 0.35 m (docs/softgym.md 5, row 25).
    """

    summary = "Spread a crumpled cloth, then fold it in half."
    difficulty, material = "hard", "cloth"
    success = 0.85  # Our choice: a mean distance of about 6 cm.
    workspace = Workspace((-0.85, -0.85, 0.0), (0.85, 0.85, 0.5))
    reset_height, view = 0.2, "fold_crumpled_cloth"
    planning_horizon, softgym_name = 30, "ClothFoldCrumpled"
    example_variation = 999
    symmetries = mirrored("rows")

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[ClothTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        cloth = Cloth(fidelity=fidelity, marker=True)
        super().__init__(cloth, CrumpledCloth(fidelity), **settings)

    def place(self, points: np.ndarray) -> np.ndarray:
        return self.cloth.particles(self.cloth.flat())
