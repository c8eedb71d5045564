"""Water of the cup that an actor moves, and shares of it in cups."""

import dataclasses

from softgym_mj import metrics
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.metrics import Array
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.tasks.shared.state import Episode, State

# [kg/m^3] Cups hold up to 26 kg of water, more than the 3 to 4 kg payload of the arms. Their water
# is as viscous, but a tenth as heavy.
ARM_DENSITY = 100.0


def carried_water(actor: object, liquid: Liquid, resolution: Resolution) -> Water:
    """Builds the water for an actor's cup; for arms it is lighter and acts on the cup.

    Args:
        actor: name of the actor.
        liquid, resolution: as in `Water`.
    """
    if actor in ARMS:
        lighter = dataclasses.replace(liquid, density=ARM_DENSITY)
        return Water(lighter, resolution, two_way=True)
    return Water(liquid, resolution)


def inside(name: str, state: State, episode: Episode) -> Array:
    """Returns which particles (..., n) are inside a cup's box."""
    return metrics.inside(state.points["water"], state.poses[name], episode.shapes[name]["size"])


def share(marks: Array, state: State) -> Array:
    """Returns the share (...) of particles with a mark (..., n) bool."""
    return metrics.fraction(marks, state.present["water"])
