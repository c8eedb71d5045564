"""Actors by name."""

from softgym_mj.exceptions import check_name
from softgym_mj.robots import picker
from softgym_mj.robots.base import Actor

ACTORS = ("picker",)
_GEOMETRY = {"cloth": picker.CLOTH_GEOMETRY, "rope": picker.ROPE_GEOMETRY}


def make_actor(actor: str, kind: str, num_grippers: int) -> Actor:
    """Builds an actor.

    Args:
        actor: one of `ACTORS`.
        kind: what it handles: "cloth" or "rope".
        num_grippers: number of grippers.

    Raises:
        UnknownNameError: if there is no such actor.
    """
    check_name("actor", actor, ACTORS)
    return picker.Picker(geometry=_GEOMETRY[kind], num_pickers=num_grippers)
