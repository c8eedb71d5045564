"""`PouringTask`: scene, observations and measures of PourWater and PourWaterAmount."""

from typing import Any

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cup import Cup
from softgym_mj.fluid import Liquid
from softgym_mj.metrics import Array
from softgym_mj.robots.cup_mover import CupTool, KeepClear
from softgym_mj.robots.factory import CUP_ACTORS
from softgym_mj.tasks.shared import entries
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.carried_water import carried_water, inside, share
from softgym_mj.tasks.shared.entries import Entries, numbers
from softgym_mj.tasks.shared.starts.cup_variations import PourCups
from softgym_mj.tasks.shared.starts.settled_water import SettledWater
from softgym_mj.tasks.shared.state import Episode, State

MAX_STEP = (0.01, 0.01, 0.015)  # [m, m, rad] per sim step: 1 m/s and 1.5 rad/s.
BASE_X = 0.5  # [m] Base of an arm.

# SoftGym's ratio of 20 in viscosity and 5 in cohesion to TransportWater (docs/softgym.md 1.3; 5,
# row 38), at values with which the water leaves the lip as a jet and splashes little.
LIQUID = Liquid(viscosity=1e-3, cohesion=5.0)


class PouringTask(Task):
    """Base of the tasks that pour the water of one cup into another.

    Attributes:
        water: the water.
        cup, target: cup that the actor moves, and cup to pour into.
    """

    actors, view, reset_height, planning_horizon = CUP_ACTORS, "pour_water", 0.0, 40

    def __init__(self, fidelity: str, **settings: Any):
        """Builds the task at a resolution of the water, with settings of `Task`."""
        start = SettledWater(PourCups(), LIQUID, fidelity)
        resolution, *sizes = start.sizes(0)
        self.cup, self.target = Cup(sizes[0]), Cup(sizes[1], name="target")
        tool = CupTool(self.cup, MAX_STEP, KeepClear("cup", "target"), BASE_X, (self.target,))
        self.water = carried_water(settings.get("actor"), LIQUID, resolution)
        super().__init__([self.water, self.target], start, tool=tool, **settings)
        self.water.confine(self.cup.body, self.target.body)

    def arrange(self, random: np.random.Generator) -> None:
        distance = PourCups().variation(self.variation).distance
        self.target.pose = np.array([distance, 0.0, 0.0])
        super().arrange(random)

    def reduced(self, state: State, episode: Episode) -> Entries:
        """Returns the poses and sizes of both cups, and the location of the water."""
        size = episode.shapes["target"]["size"]
        both = (share(inside(name, state, episode), state) for name in ("target", "cup"))
        return {
            **entries.cup("cup", state, episode),
            "target x": numbers(state.poses["target"][..., :1], "m"),
            "target height, inner length, inner width": numbers(
                metrics.columns(size[..., 2], size[..., 0], size[..., 1]), "m"
            ),
            **entries.highest_particle(state),
            "fraction in the target's box, fraction in the cup's": numbers(metrics.columns(*both)),
        }

    def extra_state(self, state: State, episode: Episode) -> Entries:
        return entries.cups(state, episode)


def fractions(state: State, episode: Episode) -> dict[str, Array]:
    """Returns the shares (...) of the water by location."""
    cup, target = (inside(name, state, episode) for name in ("cup", "target"))
    marks = {
        "poured": target & ~cup,
        "fraction_in_cup": cup,
        "fraction_in_target": target,
        "spilled": ~cup & ~target,
    }
    return {name: share(mark, state) for name, mark in marks.items()}
