"""The task PourWater."""

from typing import Unpack

from softgym_mj.metrics import Measures
from softgym_mj.tasks.shared.pouring import PouringTask, fractions
from softgym_mj.tasks.shared.settings import CupTaskSettings
from softgym_mj.tasks.shared.state import Episode, State


class PourWater(PouringTask):
    """Pour the water of one cup into another.

    Goal: all water in the target cup.
    Actions: dx, dz (1 is 0.01 m per sim step) and dtheta (1 is 0.015 rad), each in [-1, 1]. The cup
    rotates about the middle of its floor. A move into the ground or the target is rejected as a
    whole; `rejected_moves` in info counts them over the sim steps of an env step.
    Observations: `reduced` (default), 13 entries: cup x, z [m], theta [rad]; its inner length,
    width, height; target x and its height, inner length, width; height of the highest particle [m];
    fractions in the target's box and in the cup's. SoftGym's target entry moves with the cup; here
    it is the target's position. `full`: all particles (x, y, z each [m]), zeros up to the largest
    sample of the fidelity (8788 times 1/2, 1 or 2), then each cup's pose and inner size, and the
    proprioception of an arm. `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: fraction of particles inside the target's box and outside the cup's, so
    lowering the cup into the target does not count. The cup's box rotates with it; SoftGym's stays
    axis-aligned.
    Bounds: lower = 0 (the start), upper = 1.
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: 224 to 8788 of SoftGym's particles at rest in a cup sized for them, and a target cup 0.27
    to 1.3 m away (docs/softgym.md 3.2), at least 2 cm clear.
    """

    summary = "Pour the water of one cup into another."
    difficulty, material = "medium", "water"
    success = 0.95  # Our choice: a twentieth of the water may be spilled or stay in the cup.
    softgym_name = "PourWater"

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[CupTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the water: "fast", "default" or "accurate".
            **settings: entries of `CupTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        super().__init__(fidelity, **settings)

    def measure(self, state: State, episode: Episode) -> Measures:
        shares = fractions(state, episode)
        poured = shares.pop("poured")
        return Measures(poured, rewards={"poured": poured}, info=shares)
