"""The task DropCloth (SoftGym: ClothDrop)."""

from typing import Unpack

from softgym_mj import metrics
from softgym_mj.metrics import Measures
from softgym_mj.tasks.shared.hanging import HangingTask
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import HangingCloth
from softgym_mj.tasks.shared.state import Episode, State

SIZES = (60, 100)  # [particles] The upper end is exclusive (docs/softgym.md 5, row 23).


class DropCloth(HangingTask):
    """Drop a hanging cloth so that it lies flat in its place on the floor.

    Goal: column i of SoftGym's particles lies at x = i rho, with rows centered about Y = 0. The two
    pickers cannot move below 0.55 m, so the cloth must be swung.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4 and picker 0, picker 1 (x, y, z
    each): 18 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the particles from their places) [m].
    Bounds: lower = performance at reset, upper = 0.
    Horizon: 30 env steps of 16 sim steps; nothing else ends an episode. The paper has 15 env
    steps of 32 sim steps (`horizon=15, action_repeat=32`).
    Start: the cloth hangs by the corners p1, p2 of column 0, 5 cm below picker 0 and picker 1,
    which hold them until an action with grip <= 0. Sides have 60 to 99 particles.
    """

    summary = "Drop a hanging cloth so that it lies flat in its place."
    difficulty, material = "medium", "cloth"
    horizon, action_repeat = 30, 16  # docs/softgym.md 1.2; 5, row 1.
    success = 0.8  # Our choice: the mean distance is 10 cm for a cloth of 0.5 m.
    view, softgym_name, folded = "drop_cloth", "ClothDrop", False
    example_variation = 800

    def __init__(
        self,
        *,
        fidelity: str = "default",
        sizes: tuple[int, int] = SIZES,
        **settings: Unpack[ClothTaskSettings],
    ):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            sizes: of the sides [particles], the upper end exclusive; the paper's are (60, 120).
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        super().__init__(HangingCloth(fidelity, sizes), **settings)

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        performance = -metrics.goal_distance(shape, state.points["cloth"], goal)
        return Measures(performance, rewards={"distance": performance})
