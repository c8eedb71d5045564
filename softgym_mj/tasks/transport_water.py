"""The task TransportWater (SoftGym: PassWater)."""

from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.marks import OUTLINE_WIDTH, GoalLine
from softgym_mj.fluid import Liquid
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.cup_mover import CupTool, Track
from softgym_mj.robots.factory import CUP_ACTORS
from softgym_mj.tasks.shared import entries
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.carried_water import carried_water, inside, share
from softgym_mj.tasks.shared.entries import Entries, numbers
from softgym_mj.tasks.shared.settings import CupTaskSettings
from softgym_mj.tasks.shared.starts.cup_variations import TransportCups
from softgym_mj.tasks.shared.starts.settled_water import SettledWater
from softgym_mj.tasks.shared.state import Episode, State

GOAL = 1.2  # [m]
MAX_STEP = (0.011, 0.0, 0.0)  # [m, m, rad] per sim step: 1.1 m/s.
LIMITS = Track(-0.25, 1.4)  # [m]
BASE_X = 0.7  # [m] Base of an arm.
SPILL_PENALTY = 10.0  # [m] Penalty if all water is spilled.

# Low viscosity, so that it sloshes, which makes the task hard (docs/softgym.md 5, row 38): 50 times
# that of water, about the particles' own exchange of momentum.
LIQUID = Liquid(viscosity=5e-5, cohesion=1.0)


class TransportWater(Task):
    """Move a cup of water to a place without spilling.

    Goal: the cup at x = 1.2 m with all water in it. The goal is the same in every variation.
    Actions: dx in [-1, 1] (1 is 0.011 m per sim step). The cup slides along X within [-0.25, 1.4]
    m; moves are clipped to these limits, which the cup in SoftGym can exceed by one step.
    Observations: `reduced` (default), 7 entries: cup x, its inner length, width and height, height
    of the highest particle [m], fractions in the cup and outside. `full`: all particles (x, y, z
    each [m]), zeros up to the largest sample of the fidelity (8788 times 1/2, 1 or 2), then the
    cup's pose and inner size, and the proprioception of an arm.
    `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -|1.2 - x| - 10 * (fraction of particles outside the cup's box) [m].
    Bounds: lower = -1.2 (the start), upper = 0. Driving on to the end stop scores 0.833: a local
    optimum for learners.
    Horizon: 75 env steps of 8 sim steps; nothing else ends an episode.
    Start: 224 to 8788 of SoftGym's particles at rest in an upright cup at x = 0, sized for them
    (docs/softgym.md 3.1).
    """

    summary = "Move a cup of water to a place without spilling."
    difficulty, material = "medium", "water"
    horizon = 75  # docs/softgym.md 1.2.
    # Our choice: within 6 cm of the goal with nothing spilled, or at it with 0.6 % spilled.
    success = 0.95
    actors, view, reset_height = CUP_ACTORS, "transport_water", 0.0
    planning_horizon, softgym_name = 7, "PassWater"

    def __init__(self, *, fidelity: str = "default", **settings: Unpack[CupTaskSettings]):
        """Builds the task.

        Args:
            fidelity: resolution of the water: "fast", "default" or "accurate".
            **settings: entries of `CupTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        start = SettledWater(TransportCups(), LIQUID, fidelity)
        resolution, size = start.sizes(0)
        self.cup = Cup(size)
        self.water = carried_water(settings.get("actor"), LIQUID, resolution)
        tool = CupTool(self.cup, MAX_STEP, LIMITS, BASE_X)
        self._outline = GoalLine(5, OUTLINE_WIDTH)
        super().__init__([self.water], start, tool=tool, marks=[self._outline], **settings)
        self.water.confine(self.cup.body)

    def draw_goal(self, goal: dict[str, np.ndarray]) -> None:
        self._outline.draw(self.cup.foot + [GOAL, 0.0])

    def measure(self, state: State, episode: Episode) -> Measures:
        away = abs(GOAL - state.poses["cup"][..., 0])
        within = share(inside("cup", state, episode), state)
        rewards = {"distance": -away, "spill": SPILL_PENALTY * (within - 1.0)}
        info = {"distance_to_target": away, "spilled": 1.0 - within}
        return Measures(metrics.total(rewards), rewards, info)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return -GOAL, 0.0

    def reduced(self, state: State, episode: Episode) -> Entries:
        within = share(inside("cup", state, episode), state)
        return {
            "cup x": numbers(state.poses["cup"][..., :1], "m"),
            "cup inner length, width, height": numbers(episode.shapes["cup"]["size"][..., :3], "m"),
            **entries.highest_particle(state),
            "fraction in the cup, fraction outside": numbers(metrics.columns(within, 1.0 - within)),
        }

    def extra_state(self, state: State, episode: Episode) -> Entries:
        return entries.cups(state, episode)
