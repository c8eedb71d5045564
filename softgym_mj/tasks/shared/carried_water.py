"""What the tasks on water share: the water of an actor's cup, and how much is in which cup."""

import dataclasses

from softgym_mj import metrics
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.metrics import Array
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.tasks.shared.state import Episode, State

# [kg/m^3] Cups hold up to 26 kg of water, more than the 3 and 4 kg that the arms can carry: theirs
# is as viscous, but a tenth as heavy.
ARM_DENSITY = 100.0


def carried_water(actor: object, liquid: Liquid, resolution: Resolution) -> Water:
    """Builds the water for an actor's cup: arms feel it, and it is light enough for them.

    Args:
        actor: its name.
        liquid, resolution: as in `Water`.
    """
    if actor in ARMS:
        lighter = dataclasses.replace(liquid, density=ARM_DENSITY)
        return Water(lighter, resolution, two_way=True)
    return Water(liquid, resolution)


def inside(name: str, state: State, episode: Episode) -> Array:
    """Which particles (..., n) are in a cup's box."""
    return metrics.inside(state.points["water"], state.poses[name], episode.shapes[name]["size"])


def share(marks: Array, state: State) -> Array:
    """Share (...) of the particles that have a mark (..., n) bool."""
    return metrics.fraction(marks, state.present["water"])
