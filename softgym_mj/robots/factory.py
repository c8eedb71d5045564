"""Actors by name: grippers for flexes, movers for cups."""

from collections.abc import Sequence

from softgym_mj.entities.cup import Cup
from softgym_mj.exceptions import check_name
from softgym_mj.robots import picker
from softgym_mj.robots.cup_mover import CupMover, Rule
from softgym_mj.robots.gripper import Gripper

GRIPPERS = ("picker",)
CUP_ACTORS = ("cup",)
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


def make_cup_actor(actor: str, cup: Cup, max_step: Sequence[float], rule: Rule) -> CupMover:
    """Builds the actor that moves a cup.

    Args:
        actor: one of `CUP_ACTORS`.
        cup: the cup.
        max_step: largest change of x [m], z [m] and theta [rad] in a sim step; 0 where fixed.
        rule: what becomes of a wanted pose.

    Raises:
        UnknownNameError: if there is no such actor.
    """
    check_name("actor", actor, CUP_ACTORS)
    return CupMover(cup, max_step, rule)
