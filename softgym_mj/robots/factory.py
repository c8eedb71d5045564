"""Actors by name: grippers for flexes, movers for cups."""

from collections.abc import Sequence

from softgym_mj.entities.cup import Cup
from softgym_mj.exceptions import OutOfRangeError, check_name
from softgym_mj.robots import pick_and_place, picker
from softgym_mj.robots.cup_mover import CupMover, Rule
from softgym_mj.robots.gripper import Gripper
from softgym_mj.robots.models import ARMS

PICKERS: dict[str, type[picker.Picker]] = {
    "picker": picker.Picker,
    "pick_and_place": pick_and_place.PickAndPlace,
    "pixel_pick_and_place": pick_and_place.PixelPickAndPlace,
}
GRIPPERS = (*PICKERS, *ARMS)
CUP_ACTORS = ("cup",)
_GEOMETRY = {"cloth": picker.CLOTH_GEOMETRY, "rope": picker.ROPE_GEOMETRY}


def make_gripper(actor: str, kind: str, num_grippers: int | None) -> Gripper:
    """Builds the actor that handles a flex.

    Args:
        actor: one of `GRIPPERS`.
        kind: what it handles: "cloth" or "rope".
        num_grippers: number of grippers; None for 2, or 1 for pixels. There are at most 2 arms.

    Raises:
        UnknownNameError: if there is no such actor.
        OutOfRangeError: if there cannot be as many.
    """
    check_name("actor", actor, GRIPPERS)
    if num_grippers is None:
        num_grippers = 1 if actor == "pixel_pick_and_place" else 2
    if actor in ARMS:
        from softgym_mj.robots import arms  # mink takes a quarter of a second to import.

        kinds = {"franka": arms.FrankaArms, "sawyer": arms.SawyerArms}
        return kinds[actor](ARMS[actor], num_grippers)
    return PICKERS[actor](geometry=_GEOMETRY[kind], num_pickers=num_grippers)


def action_repeat_of(actor: str, action_repeat: int | None, usual: int) -> int:
    """Sim steps for which an action is repeated.

    Args:
        actor: one of `GRIPPERS`.
        action_repeat: what the user wants, or None.
        usual: what the task has with actors that move by displacement.

    Raises:
        UnknownNameError: if there is no such actor.
        OutOfRangeError: if an action that takes as long as it needs is to be repeated.
    """
    check_name("actor", actor, GRIPPERS)
    once = issubclass(PICKERS.get(actor, picker.Picker), pick_and_place.RoutePicker)
    if once and action_repeat not in (None, 1):
        raise OutOfRangeError("action_repeat", action_repeat, f"1 with actor={actor!r}")
    if once:
        return 1
    return usual if action_repeat is None else action_repeat


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
