"""TransportWater (SoftGym: PassWater): move a cup of water to a place without spilling.

Goal: the cup at x = 1.2 m, all water in it. The cup starts at 0 and slides along X, at most 0.011 m
a sim step, within [-0.25, 1.4] m; 75 env steps of 8 sim steps. SoftGym lets the walls poke over
these limits by a step; here the move is clipped first.

Reward = performance: -|1.2 - x| - 10 * (fraction of particles outside the cup's box) [m].
Bounds: lower = -1.2 (the start), upper = 0.
Reduced state, 7 entries: cup x, its inner length, width and height, height of the highest particle
[m], fraction in the cup, fraction outside. The goal is the same in every variation.
Full state: see `WaterTask`.
Start: 224 to 8788 of SoftGym's particles at rest in a cup made for them (facts 3.1), upright.
End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

from softgym_mj import metrics
from softgym_mj.entities.cup import Cup
from softgym_mj.fluid import Liquid, Water
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.cup_mover import CupMover, CupTool, Track
from softgym_mj.robots.factory import CupActorSettings, make_actor
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.cups import TransportScenes
from softgym_mj.tasks.shared.starts.settled_water import SettledWater
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.water_task import WaterTask, inside, make_water

ACTION_REPEAT = 8  # Facts 1.2.
GOAL = 1.2  # [m]
MAX_STEP = (0.011, 0.0, 0.0)  # [m, m, rad] in a sim step: 1.1 m/s.
LIMITS = Track(-0.25, 1.4)  # [m]
BASE_X = 0.7  # [m] Of an arm.
SPILL_PENALTY = 10.0  # [m] For all water spilled.
SUCCESS = 0.95  # Ours: within 6 cm of the goal with nothing spilled, or at it with 0.6 %.

# Thin, so that it sloshes, which is the difficulty (facts 5, row 46): 50 times as viscous as water,
# about what the particles' own exchange of momentum amounts to.
LIQUID = Liquid(viscosity=5e-5, cohesion=1.0)


class TransportWater(WaterTask):
    """See the module docstring."""

    def __init__(
        self, initializer: SettledWater, water: Water, cup: Cup, actor: CupMover, **settings
    ):
        """Wires the task; `settings` as in `WaterTask`."""
        super().__init__("transport_water", SUCCESS, initializer, water, [cup], actor, **settings)

    def measure(self, state: State, episode: Episode) -> Measures:
        away = abs(GOAL - state.poses["cup"][..., 0])
        share = self._fraction_inside(state, episode)
        rewards = {"distance": -away, "spill": SPILL_PENALTY * (share - 1.0)}
        info = {"distance_to_target": away, "spilled": 1.0 - share}
        return Measures(sum(rewards.values()), rewards, info)

    def _fraction_inside(self, state: State, episode: Episode) -> Array:
        return metrics.fraction(inside("cup", state, episode), state.present["water"])

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return -GOAL, 0.0

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        share = self._fraction_inside(state, episode)
        top = metrics.highest(state.points["water"], state.present["water"])
        return {
            "cup x [m]": state.poses["cup"][..., :1],
            "cup inner length, width, height [m]": episode.shapes["cup"]["size"][..., :3],
            "height of the highest particle [m]": top[..., None],
            "fraction in the cup, fraction outside": metrics.columns(share, 1.0 - share),
        }


def transport_water(
    *,
    actor: str = "cup",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    draw: str = "surface",
    action_repeat: int = ACTION_REPEAT,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[CupActorSettings],
) -> TransportWater:
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
    scenes = TransportScenes()
    scene = scenes.scene(0)
    cup = Cup(scene.cup)
    return TransportWater(
        SettledWater(scenes, LIQUID, fidelity),
        make_water(actor, LIQUID, scene.resolution(fidelity), draw),
        cup,
        make_actor(actor, CupTool(cup, MAX_STEP, LIMITS, BASE_X), **actor_settings),
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat,
        domain=domain,
    )
