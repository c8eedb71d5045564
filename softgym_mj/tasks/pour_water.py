"""PourWater and PourWaterAmount: pour the water of one cup, or a part of it, into another.

Goal: all water in the target cup; in PourWaterAmount a share t of it, uniform in 0.1..1 and marked
by a red bar on the target's inner wall, about where the water will stand. The cup moves along X and
Z, at most 0.01 m a sim step each, and turns about the middle of its floor, at most 0.015 rad a sim
step; 100 env steps of 8 sim steps. A move that would put it into the ground or the target is
rejected as a whole; info counts these (`rejected_moves` of the env step's sim steps).

Reward = performance: fraction of particles in the target's box and not in the cup's, so that
lowering the cup into the target does not count. The cup's box turns with it, where SoftGym's stays
along the axes.
PourWaterAmount: -|floor(N t) - N_poured| / N, N particles.
Bounds: lower = 0 (the start), upper = 1; PourWaterAmount: lower = at reset, upper = 0 (SoftGym's 1
cannot be reached).
Reduced state, 13 entries: cup x, z [m], theta [rad]; its inner length, width, height; target x and
its height, inner length, width; height of the highest particle [m]; fraction in the target's box,
fraction in the cup's. Where SoftGym's target entry moves with the cup, ours is where it stands.
PourWaterAmount appends the height of the red bar [m] and t: 15 entries.
Full state: see `WaterTask`; PourWaterAmount appends the same two.
Start: 224 to 8788 of SoftGym's particles at rest in a cup made for them, a target cup 0.27 to 1.3 m
away (facts 3.2), at least 2 cm clear. End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np

from softgym_mj.entities.cup import Cup
from softgym_mj.entities.marks import LevelMark
from softgym_mj.fluid import Liquid, Water
from softgym_mj.robots.cup_mover import CupMover, KeepClear
from softgym_mj.robots.factory import CupActorSettings, make_cup_actor, make_water
from softgym_mj.tasks.base import Entries, Evaluation
from softgym_mj.tasks.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.settled_water import SettledWater
from softgym_mj.tasks.water_scenes import PourScenes
from softgym_mj.tasks.water_task import WaterTask, pose_entries
from softgym_mj.variations.store import generator

ACTION_REPEAT = 8  # Facts 1.2.
MAX_STEP = (0.01, 0.01, 0.015)  # [m, m, rad] in a sim step: 1 m/s and 1.5 rad/s.
BASE_X = 0.5  # [m] Of an arm.
SUCCESS = 0.95  # Ours: a twentieth of the water may be spilled or stay in the cup,
AMOUNT_SUCCESS = 0.9  # or a tenth of the share be missing or too much.

GOAL_ENTRIES = (
    Entries("height of the red bar", 1, "m"),
    Entries("share t to be poured", 1, ""),
)

# SoftGym's contrast of 20 in viscosity and 5 in cohesion to TransportWater (facts 1.3; 5, row 46),
# at values with which the water leaves the lip as a jet and splashes little.
LIQUID = Liquid(viscosity=1e-3, cohesion=5.0)


class PourWater(WaterTask):
    """See the module docstring."""

    _threshold = SUCCESS

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
            "pour_water", self._threshold, initializer, water, [cup, target], actor, **settings
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

    def water_state(self) -> np.ndarray:
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

    @property
    def reduced_entries(self) -> tuple[Entries, ...]:
        return (
            *pose_entries("cup"),
            Entries("target x", 1, "m"),
            Entries("target height, inner length, inner width", 3, "m"),
            Entries("height of the highest particle", 1, "m"),
            Entries("fraction in the target's box, fraction in the cup's", 2, ""),
        )


class PourWaterAmount(PourWater):
    """See the module docstring."""

    _threshold = AMOUNT_SUCCESS

    def __init__(self, *parts, **settings):
        """Wires the task like `PourWater`."""
        self._share, self._level = 1.0, 0.0
        super().__init__(*parts, **settings)
        self._mark = LevelMark()
        self.root_entity.attach(self._mark)

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        return {**super().parts, "goal": (self._mark.mjcf_model.model,)}

    @property
    def share(self) -> float:
        """Fraction of the water that ought to be poured."""
        return self._share

    @property
    def level(self) -> float:
        """Height of the red bar [m]."""
        return self._level

    def start(self, state: np.ndarray) -> None:
        super().start(state)
        self._share = goal_share(self.variation)
        cup, target = self.cup.size, self.target.size
        # Facts 3.3: the water of the upright cup, laid on the target's floor.
        depth = self.highest() - cup.wall / 2
        floors = (cup.length * cup.width) / (target.length * target.width)
        self._level = target.wall / 2 + self._share * depth * floors
        near = self.target.pose[0] - target.length / 2
        self._mark.draw(near, self._level, target.width)

    def evaluate(self) -> Evaluation:
        whole = super().evaluate()
        number = self.water.num_particles
        missing = int(number * self._share) / number - whole.performance
        return Evaluation(
            performance=-abs(missing),
            reward_terms={"missing": -abs(missing)},
            measures={**whole.measures, "poured": whole.performance, "share": self._share},
        )

    def bounds(self) -> tuple[float, float]:
        return self.initial_performance, 0.0

    def water_state(self) -> np.ndarray:
        return np.array([*super().water_state(), self._level, self._share])

    def containers_state(self) -> np.ndarray:
        """The cups (12,), then the height of the red bar [m] and t."""
        return np.array([*super().containers_state(), self._level, self._share])

    @property
    def reduced_entries(self) -> tuple[Entries, ...]:
        return (*super().reduced_entries, *GOAL_ENTRIES)

    @property
    def tool_entries(self) -> tuple[Entries, ...]:
        return (*super().tool_entries, *GOAL_ENTRIES)


def goal_share(variation: int) -> float:
    """Fraction of the water to pour in a variation (facts 5, row 13)."""
    return float(generator("pour_water_amount", variation).uniform(0.1, 1.0))


def _parts(actor: str, fidelity: str, draw: str, settings: CupActorSettings) -> tuple:
    """What `PourWater` is made of."""
    scenes = PourScenes()
    scene = scenes.scene(0)
    cup, target = Cup(scene.cups[0]), Cup(scene.cups[1], name="target")
    return (
        SettledWater(scenes, LIQUID, fidelity),
        make_water(actor, LIQUID, scene.resolution(fidelity), draw),
        cup,
        target,
        make_cup_actor(actor, cup, MAX_STEP, KeepClear(cup, target), base_x=BASE_X, **settings),
    )


def pour_water(
    *,
    actor: str = "cup",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    draw: str = "surface",
    action_repeat: int = ACTION_REPEAT,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[CupActorSettings],
) -> PourWater:
    """Builds the task.

    Args:
        actor: "cup", "franka" or "sawyer".
        observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
        image_size: (height, width) of images [pixels].
        fidelity: number of particles: "fast", "default" or "accurate".
        draw: how the water is drawn: "surface", "fine" (smoother, slower), "particles" or "none".
        action_repeat: sim steps per env step.
        domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
            "out_of_distribution", or a dict of parameters, as in `Domain`.
        **actor_settings: as in `CupActorSettings`.
    """
    return PourWater(
        *_parts(actor, fidelity, draw, actor_settings),
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat,
        domain=domain,
    )


def pour_water_amount(
    *,
    actor: str = "cup",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    draw: str = "surface",
    action_repeat: int = ACTION_REPEAT,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[CupActorSettings],
) -> PourWaterAmount:
    """Builds the task; arguments as for `pour_water`."""
    return PourWaterAmount(
        *_parts(actor, fidelity, draw, actor_settings),
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat,
        domain=domain,
    )
