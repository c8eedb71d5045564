"""The task DropFoldCloth (SoftGym: ClothFoldDrop)."""

from typing import Unpack

from softgym_mj.tasks.shared.hanging import HangingTask
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import HangingCloth


class DropFoldCloth(HangingTask):
    """Drop a hanging cloth so that it lies folded in half.

    Goal: column i of the second half of SoftGym's particles lies at x = i rho, with rows centered
    about Y = 0; the columns of the first half lie on their mirror columns. The two pickers cannot
    move below 0.55 m, so the cloth must be swung.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4 and picker 0, picker 1 (x, y, z
    each): 18 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the mirror pairs) - 1.2 (mean distance of the second
    half from its place) [m], over SoftGym's particles. In SoftGym's code the place is the hanging
    cloth, which contradicts its paper.
    Bounds: lower = performance at reset, upper = 0. Only distances count: a pile in the right place
    scores 0.7; `outline_iou` and `wrinkle_height` in info distinguish it from a fold.
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the cloth hangs by the corners p1, p2 of column 0, 5 cm below picker 0 and picker 1,
    which hold them until an action with grip <= 0. Sides have 60 to 119 particles.
    """

    summary = "Drop a hanging cloth so that it lies folded in half."
    difficulty, material = "hard", "cloth"
    success = 0.85  # Our choice: folded with some wrinkles; a pile in the right place scores 0.7.
    view, softgym_name = "drop_fold_cloth", "ClothFoldDrop"
    planning_horizon, example_variation = 30, 953

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[ClothTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        super().__init__(HangingCloth(fidelity), **settings)
