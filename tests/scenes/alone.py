"""A flex alone in an arena."""

from dm_control import mjcf

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import Flex


def compiled(flex: Flex) -> mjcf.Physics:
    """Compiles an arena in which a flex is; returns its physics."""
    arena = Arena()
    arena.attach(flex)
    return arena.compile(flex.timestep, flex)
