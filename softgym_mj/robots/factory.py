"""Grippers by name."""

from softgym_mj.exceptions import check_name
from softgym_mj.robots import picker
from softgym_mj.robots.gripper import Gripper

GRIPPERS = ("picker",)
_GEOMETRY = {"cloth": picker.CLOTH_GEOMETRY, "rope": picker.ROPE_GEOMETRY}


def make_gripper(actor: str, kind: str, num_grippers: int) -> Gripper:
    """Builds the actor that handles a flex.

    Args:
        actor: one of `GRIPPERS`.
        kind: what it handles: "cloth" or "rope".
        num_grippers: number of grippers.

    Raises:
        UnknownNameError: if there is no such actor.
    """
    check_name("actor", actor, GRIPPERS)
    return picker.Picker(geometry=_GEOMETRY[kind], num_pickers=num_grippers)
