"""Actors by name: grippers for flexes, movers for cups."""

from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.robots import pick_and_place, picker
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.cup_mover import CupMover, CupTool

PICKERS: dict[str, type[picker.Picker]] = {
    kind.name: kind
    for kind in (picker.Picker, pick_and_place.PickAndPlace, pick_and_place.PixelPickAndPlace)
}
GRIPPERS = (*PICKERS, *ARMS)
CUP_ACTORS = ("cup", *ARMS)
_GEOMETRY = {"cloth": picker.CLOTH_GEOMETRY, "rope": picker.ROPE_GEOMETRY}


def make_actor(
    actor: str,
    material: str | CupTool,
    *,
    base_height: float = 0.0,
    num_pickers: int | None = None,
    arms: int | None = None,
    grasp: str | None = None,
    visual: str | None = None,
    action: str | None = None,
) -> Any:
    """Builds an actor.

    Args:
        actor: one of `GRIPPERS`, or of `CUP_ACTORS` for a cup.
        material: what it handles: "cloth", "rope", or a cup.
        base_height: height of arms' bases above the floor [m].
        num_pickers: number of pickers; None for 2, or 1 for pixels. Not for arms.
        arms: number of arms, 1 or 2; None for 2. Only for arms.
        grasp: how arms hold: "attach" or "friction"; None for "attach". Only for arms.
        visual: appearance of arms: "primitive" (as with None) or "menagerie". Only for arms.
        action: meaning of arms' actions: "position" (as with None), "pose" or "joints". Only for
            arms; those that hold a cup have one kind.

    Raises:
        InvalidArgumentError: if there is no such actor, material, grasp, look or action; if the
            number is not possible, or for a setting of other actors.
        UnavailableError: if Menagerie's model is not available.
    """
    look = "primitive" if visual is None else visual
    if isinstance(material, CupTool):
        check_name("actor", actor, CUP_ACTORS)
        others = {"num_pickers": num_pickers, "arms": arms, "grasp": grasp}
        _refuse(others, "None: one actor moves the cup")
        _refuse({"action": action}, "None: a cup moves along X and Z and turns about Y")
        if actor in ARMS:
            from softgym_mj.robots.arm.cup_arm import CupArm

            return CupArm(ARMS[actor], material, look)
        _refuse({"visual": visual}, f"None with actor={actor!r}")
        return CupMover(material)
    check_name("actor", actor, GRIPPERS)
    check_name("material", material, _GEOMETRY)
    if actor in ARMS:
        _refuse({"num_pickers": num_pickers}, "None: arms are counted by `arms`")
        from softgym_mj.robots.arm.arms import Arms  # mink takes a quarter of a second to import.

        number, grasp = 2 if arms is None else arms, "attach" if grasp is None else grasp
        action = "position" if action is None else action
        return Arms(ARMS[actor], number, base_height, grasp=grasp, visual=look, action=action)
    others = {"arms": arms, "grasp": grasp, "visual": visual, "action": action}
    _refuse(others, f"None with actor={actor!r}")
    if num_pickers is None:
        num_pickers = 1 if actor == "pixel_pick_and_place" else 2
    return PICKERS[actor](geometry=_GEOMETRY[material], num_pickers=num_pickers)


def _refuse(settings: Mapping[str, object], valid: str) -> None:
    """Raises `InvalidArgumentError` for the first of `settings` that is not None."""
    for name, value in settings.items():
        if value is not None:
            raise InvalidArgumentError(name, value, valid)
