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

from softgym_mj import metrics
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.marks import LevelMark
from softgym_mj.fluid import Liquid, Water
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.cup_mover import CupMover, CupTool, KeepClear
from softgym_mj.robots.factory import CupActorSettings, make_actor
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.cups import PourScenes
from softgym_mj.tasks.shared.starts.settled_water import SettledWater
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.water_task import WaterTask, cup_state, inside, make_water
from softgym_mj.variations.indices import generator

ACTION_REPEAT = 8  # Facts 1.2.
MAX_STEP = (0.01, 0.01, 0.015)  # [m, m, rad] in a sim step: 1 m/s and 1.5 rad/s.
BASE_X = 0.5  # [m] Of an arm.
SUCCESS = 0.95  # Ours: a twentieth of the water may be spilled or stay in the cup,
AMOUNT_SUCCESS = 0.9  # or a tenth of the share be missing or too much.

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

    def measure(self, state: State, episode: Episode) -> Measures:
        shares = fractions(state, episode)
        poured = shares.pop("poured")
        return Measures(poured, rewards={"poured": poured}, info=shares)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return 0.0, 1.0

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        shares, size = fractions(state, episode), episode.shapes["target"]["size"]
        top = metrics.highest(state.points["water"], state.present["water"])
        both = metrics.columns(shares["fraction_in_target"], shares["fraction_in_cup"])
        sides = metrics.columns(size[..., 2], size[..., 0], size[..., 1])
        return {
            **cup_state("cup", state, episode),
            "target x [m]": state.poses["target"][..., :1],
            "target height, inner length, inner width [m]": sides,
            "height of the highest particle [m]": top[..., None],
            "fraction in the target's box, fraction in the cup's": both,
        }


class PourWaterAmount(PourWater):
    """See the module docstring."""

    _threshold = AMOUNT_SUCCESS

    def __init__(self, *parts, **settings):
        """Wires the task like `PourWater`."""
        super().__init__(*parts, **settings)
        self._mark = LevelMark()
        self.root_entity.attach(self._mark)

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        return {**super().parts, "goal": (self._mark.mjcf_model.model,)}

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Fraction `share` of the water that ought to be poured, height `level` [m] of the bar."""
        share, cup, target = goal_share(variation), self.cup.size, self.target.size
        # Facts 3.3: the water of the upright cup, laid on the target's floor.
        depth = points["water"][:, 2].max() - cup.wall / 2
        floors = (cup.length * cup.width) / (target.length * target.width)
        return {
            "share": np.array(share),
            "level": np.array(target.wall / 2 + share * depth * floors),
        }

    def show(self, goal: dict[str, np.ndarray]) -> None:
        near = self.target.pose[0] - self.target.size.length / 2
        self._mark.draw(near, float(goal["level"]), self.target.size.width)

    def measure(self, state: State, episode: Episode) -> Measures:
        whole, share = super().measure(state, episode), episode.goal["share"]
        number = state.present["water"].sum(axis=-1)
        missing = number * share // 1 / number - whole.performance
        rewards = {"missing": -abs(missing)}
        info = {**whole.info, "poured": whole.performance, "share": share}
        return Measures(rewards["missing"], rewards, info)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def _goal_state(self, episode: Episode) -> dict[str, Array]:
        return {
            "height of the red bar [m]": episode.goal["level"][..., None],
            "share t to be poured": episode.goal["share"][..., None],
        }

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        return {**super().reduced(state, episode), **self._goal_state(episode)}

    def beside(self, state: State, episode: Episode) -> dict[str, Array]:
        return {**super().beside(state, episode), **self._goal_state(episode)}


def fractions(state: State, episode: Episode) -> dict[str, Array]:
    """Shares (...) of the water by where it is."""
    cup, target = (inside(name, state, episode) for name in ("cup", "target"))
    marks = {
        "poured": target & ~cup,
        "fraction_in_cup": cup,
        "fraction_in_target": target,
        "spilled": ~cup & ~target,
    }
    return {k: metrics.fraction(v, state.present["water"]) for k, v in marks.items()}


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
        make_actor(actor, CupTool(cup, MAX_STEP, KeepClear(cup, target), BASE_X), **settings),
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
