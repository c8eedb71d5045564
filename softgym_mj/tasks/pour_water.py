"""PourWater: pour the water of one cup into another.

Goal: all water in the target cup. The cup moves along X and Z, at most 0.01 m a sim step each, and
turns about the middle of its floor, at most 0.015 rad a sim step; 100 env steps of 8 sim steps. A
move that would put it into the ground or the target is rejected as a whole; info counts these
(`rejected_moves` of the env step's sim steps).

Reward = performance: fraction of particles in the target's box and not in the cup's, so that
lowering the cup into the target does not count. The cup's box turns with it, where SoftGym's stays
along the axes.
Bounds: lower = 0 (the start), upper = 1.
Reduced state, 13 entries: cup x, z [m], theta [rad]; its inner length, width, height; target x and
its height, inner length, width; height of the highest particle [m]; fraction in the target's box,
fraction in the cup's. Where SoftGym's target entry moves with the cup, ours is where it stands.
Full state: see `WaterTask`.
Start: 224 to 8788 of SoftGym's particles at rest in a cup made for them, a target cup 0.27 to 1.3 m
away (facts 3.2), at least 2 cm clear. End: horizon only.
"""

from collections.abc import Sequence

import numpy as np

from softgym_mj.entities.cup import Cup
from softgym_mj.fluid import Liquid, Water
from softgym_mj.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.robots.cup_mover import CupMover, KeepClear
from softgym_mj.robots.factory import make_cup_actor
from softgym_mj.tasks.base import Evaluation
from softgym_mj.tasks.settled_water import SettledWater
from softgym_mj.tasks.water_scenes import PourScenes
from softgym_mj.tasks.water_task import WaterTask

ACTION_REPEAT = 8  # Facts 1.2.
MAX_STEP = (0.01, 0.01, 0.015)  # [m, m, rad] in a sim step: 1 m/s and 1.5 rad/s.
SUCCESS = 0.95  # Ours: a twentieth of the water may be spilled or stay in the cup.

# SoftGym's contrast of 20 in viscosity and 5 in cohesion to TransportWater (facts 1.3; 5, row 46),
# at values with which the water leaves the lip as a jet and splashes little.
LIQUID = Liquid(viscosity=1e-3, cohesion=5.0)


class PourWater(WaterTask):
    """See the module docstring."""

    def __init__(
        self,
        initializer: SettledWater,
        water: Water,
        cup: Cup,
        target: Cup,
        actor: CupMover,
        **settings,
    ):
        """Wires the task; `settings` as in `WaterTask`."""
        self._target = target
        super().__init__(
            "pour_water", SUCCESS, initializer, water, [cup, target], actor, **settings
        )

    @property
    def target(self) -> Cup:
        """The cup to pour into."""
        return self._target

    def evaluate(self) -> Evaluation:
        positions = self.water.positions()
        in_cup, in_target = self.cup.inside(positions), self.target.inside(positions)
        poured = float(np.mean(in_target & ~in_cup))
        return Evaluation(
            performance=poured,
            reward_terms={"poured": poured},
            measures={
                "fraction_in_cup": float(np.mean(in_cup)),
                "fraction_in_target": float(np.mean(in_target)),
                "spilled": float(np.mean(~in_cup & ~in_target)),
            },
        )

    def bounds(self) -> tuple[float, float]:
        return 0.0, 1.0

    def reduced_state(self) -> np.ndarray:
        positions, size, target = self.water.positions(), self.cup.size, self.target.size
        return np.array(
            [
                *self.cup.pose,
                *(size.length, size.width, size.height),
                self.target.pose[0],
                *(target.height, target.length, target.width),
                self.highest(),
                np.mean(self.target.inside(positions)),
                np.mean(self.cup.inside(positions)),
            ]
        )


def pour_water(
    *,
    actor: str = "cup",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    draw: str = "surface",
    action_repeat: int = ACTION_REPEAT,
) -> PourWater:
    """Builds the task.

    Args:
        actor: "cup".
        observation: "full", "reduced", "rgb" or a sequence of these.
        image_size: (height, width) of images [pixels].
        fidelity: number of particles: "fast", "default" or "accurate".
        draw: how the water is drawn: "surface", "fine" (smoother, slower), "particles" or "none".
        action_repeat: sim steps per env step.
    """
    scenes = PourScenes()
    scene = scenes.scene(0)
    cup, target = Cup(scene.cups[0]), Cup(scene.cups[1], name="target")
    return PourWater(
        SettledWater(scenes, LIQUID, fidelity),
        Water(LIQUID, scene.resolution(fidelity), draw),
        cup,
        target,
        make_cup_actor(actor, cup, MAX_STEP, KeepClear(cup, target)),
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat,
    )
