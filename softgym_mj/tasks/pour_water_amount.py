"""The task PourWaterAmount."""

from typing import Unpack

import numpy as np

from softgym_mj.entities.marks import LevelMark
from softgym_mj.metrics import Array, Measures
from softgym_mj.tasks.shared.entries import Entries, Entry, numbers
from softgym_mj.tasks.shared.goals import Goals
from softgym_mj.tasks.shared.pouring import PouringTask, fractions
from softgym_mj.tasks.shared.settings import CupTaskSettings
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import generator


class PourGoals(Goals):
    """Share of the water to pour, in whole particles: k = 1."""

    def achieved(self, state: State, episode: Episode) -> Array:
        return fractions(state, episode)["poured"][..., None]

    def desired(self, state: State, episode: Episode) -> Array:
        number = state.present["water"].sum(axis=-1)
        return (number * episode.goal["share"] // 1 / number)[..., None]

    def reward(self, achieved: Array, desired: Array) -> Array:
        return -abs(desired - achieved)[..., 0]


class PourWaterAmount(PouringTask):
    """Pour a given share of the water of one cup into another.

    Goal: a share t of the water in the target cup, uniform in 0.1 to 1. A red bar on the target's
    inner wall marks about the height of that water; images show it unless `goal_marks=False`.
    Actions: dx, dz (1 is 0.01 m per sim step) and dtheta (1 is 0.015 rad), each in [-1, 1]. The cup
    rotates about the middle of its floor. A move into the ground or the target is rejected as a
    whole; `rejected_moves` in info counts them over the sim steps of an env step.
    Observations: `reduced` (default), 15 entries: cup x, z [m], theta [rad]; its inner length,
    width, height; target x and its height, inner length, width; height of the highest particle [m];
    fractions in the target's box and in the cup's; height of the red bar [m] and t. SoftGym's
    target entry moves with the cup; here it is the target's position. `full`: all particles (x, y,
    z each [m]), zeros up to the largest sample of the fidelity (8788 times 1/2, 1 or 2), then each
    cup's pose and inner size, the height of the bar, t, and the proprioception of an arm.
    `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -|floor(N t) - N_poured| / N with N particles, of which those inside the
    target's box and outside the cup's are poured. The cup's box rotates with it; SoftGym's stays
    axis-aligned.
    Bounds: lower = performance at reset, upper = 0 (SoftGym's 1 cannot be reached).
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode. PourWater has the same
    actions and step, so its policies can be loaded here. SoftGym's code simulates 16 sim steps at
    half the speed by mistake (docs/softgym.md 5, row 41).
    Start: 224 to 8788 of SoftGym's particles at rest in a cup sized for them, and a target cup 0.27
    to 1.3 m away (docs/softgym.md 3.2), at least 2 cm clear.
    """

    summary = "Pour a given share of the water of one cup into another."
    difficulty, material = "hard", "water"
    success = 0.9  # Our choice: a tenth of the share may be missing or too much.
    softgym_name, hidden_goal, goals = "PourWaterAmount", True, PourGoals

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[CupTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the water: "fast", "default" or "accurate".
            **settings: entries of `CupTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        self._mark = LevelMark()
        super().__init__(fidelity, marks=[self._mark], **settings)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns the fraction `share` of the water to pour and the bar's height `level` [m]."""
        share, cup, target = goal_share(variation), self.cup.size, self.target.size
        # docs/softgym.md 3.3: the water of the upright cup at rest on the target's floor.
        depth = points["water"][:, 2].max() - cup.wall / 2
        floors = (cup.length * cup.width) / (target.length * target.width)
        level = target.wall / 2 + share * depth * floors
        return {"share": np.array(share), "level": np.array(level)}

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        near = self.target.pose[0] - self.target.size.length / 2
        self._mark.draw(near, float(goal["level"]), self.target.size.width)

    def measure(self, state: State, episode: Episode) -> Measures:
        shares, share = fractions(state, episode), episode.goal["share"]
        number = state.present["water"].sum(axis=-1)
        missing = number * share // 1 / number - shares["poured"]
        rewards = {"missing": -abs(missing)}
        return Measures(rewards["missing"], rewards, info={**shares, "share": share})

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def reduced(self, state: State, episode: Episode) -> Entries:
        return {**super().reduced(state, episode), **_goal_entries(episode)}

    def extra_state(self, state: State, episode: Episode) -> Entries:
        return {**super().extra_state(state, episode), **_goal_entries(episode)}


def _goal_entries(episode: Episode) -> dict[str, Entry]:
    return {
        "height of the red bar": numbers(episode.goal["level"][..., None], "m"),
        "share t to be poured": numbers(episode.goal["share"][..., None]),
    }


def goal_share(variation: int) -> float:
    """Returns the fraction of the water to pour in a variation (docs/softgym.md 5, row 10)."""
    return float(generator("pour_water_amount", variation).uniform(0.1, 1.0))
