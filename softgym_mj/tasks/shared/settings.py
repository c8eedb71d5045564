"""Keyword arguments that constructors of tasks take and pass on as `**settings`."""

import inspect
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypedDict, Unpack

from softgym_mj.robots.base import Actor

_ENTRY = re.compile(r"^(\w+): .*(?:\n    .*)*", re.MULTILINE)  # Of the docstrings below.


class CupTaskSettings(TypedDict, total=False):
    """What all tasks take; those on water take nothing else.

    actor: what acts, one of the `actors` of the task's class, whose first is usual; or an `Actor`.
    visual: what arms look like: "primitive", our own shapes (as with None), or "menagerie", the
        meshes of MuJoCo Menagerie. Only for arms.
    observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
    image_size: (height, width) of images [pixels].
    goal_marks: whether "rgb", "external_rgb" and "wrist_rgb" show the marks of the goal that
        `render` draws; depths, labels and point clouds never do. Tasks without marks refuse True.
    look: how finely it is drawn: "fast", or "paper" for what is shown to people; a name of
        `rendering.look.LOOKS`. Nothing else depends on it.
    action_repeat: sim steps of 0.01 s per env step; None for the usual number.
    domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
        "out_of_distribution", "fabrics" as they occur, or a dict of parameters, as in
        `DomainRandomization`.

    Those of the package name these themselves:

    fidelity: resolution of rope, cloth and water: "fast", "default" or "accurate".
    """

    actor: str | Actor | None
    visual: str | None
    observation: str | Sequence[str]
    image_size: tuple[int, int]
    goal_marks: bool
    look: str
    action_repeat: int | None
    domain: str | Mapping[str, object]


class TaskSettings(CupTaskSettings, total=False):
    """What tasks take whose actor has grippers.

    num_pickers: number of pickers; None for 2, or 1 for pixels. Not for arms.
    arms: number of arms, 1 or 2; None for 2. Only for arms.
    grasp: how arms hold: "attach" or "friction"; None for "attach". Only for arms.
    action: what the entries of arms' actions are: "position", "pose" or "joints"; None for
        "position". Only for arms.
    """

    num_pickers: int | None
    arms: int | None
    grasp: str | None
    action: str | None


class ClothTaskSettings(TaskSettings, total=False):
    """What tasks on cloth take.

    count_intersections: adds "intersections" to info: where the cloth passes through itself.
    """

    count_intersections: bool


ALL = CupTaskSettings, TaskSettings, ClothTaskSettings


def show_settings(constructor: Callable, passed_to: Callable) -> None:
    """Has `help` show what a constructor takes by `**settings: Unpack[...]`, and what it is.

    Args:
        constructor: whose signature and docstring get longer.
        passed_to: where it passes settings on, which has their usual values.
    """
    signature = inspect.signature(constructor)
    *own, last = signature.parameters.values()
    if typing.get_origin(last.annotation) is not Unpack:
        return
    (settings,) = typing.get_args(last.annotation)
    usual = inspect.signature(passed_to).parameters
    passed = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=usual[name].default if name in usual else None,  # Of the actor, all None.
            annotation=kind,
        )
        for name, kind in typing.get_type_hints(settings).items()
        if name not in signature.parameters
    ]
    known, said = _words(*ALL, settings), inspect.getdoc(constructor) or ""
    shown = [p.name for p in (*own, *passed) if p.name in known and f"{p.name}: " not in said]
    lines = "\n".join(known[name] for name in shown).replace("\n", "\n    ")
    head, _, rest = said.partition("\n\nArgs:\n")
    constructor.__doc__ = f"{head}\n\nArgs:\n    {lines}\n{rest}"
    whole = signature.replace(parameters=[*own, *passed])
    constructor.__signature__ = whole  # type: ignore[attr-defined]


def _words(*settings: Any) -> dict[str, str]:
    """What docstrings of these say of each argument."""
    said = "\n".join(inspect.getdoc(each) or "" for each in settings)
    return {entry[1]: entry[0] for entry in _ENTRY.finditer(said)}
