"""Keyword arguments that constructors of tasks take and pass on as `**settings`."""

from collections.abc import Mapping, Sequence
from typing import TypedDict

from softgym_mj.robots.base import Actor


class CupTaskSettings(TypedDict, total=False):
    """What all tasks take; those on water take nothing else.

    actor: what acts, one of the `actors` of the task's class, whose first is usual; or an `Actor`.
    visual: what arms look like: "primitive", our own shapes (as with None), or "menagerie", the
        meshes of MuJoCo Menagerie. Only for arms.
    observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
    image_size: (height, width) of images [pixels].
    look: how finely it is drawn: "fast", or "paper" for what is shown to people; a name of
        `rendering.look.LOOKS`. Nothing else depends on it.
    action_repeat: sim steps of 0.01 s per env step; None for the usual number.
    domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
        "out_of_distribution", or a dict of parameters, as in `DomainRandomization`.

    Those of the package name these themselves:

    fidelity: resolution of rope, cloth and water: "fast", "default" or "accurate".
    """

    actor: str | Actor | None
    visual: str | None
    observation: str | Sequence[str]
    image_size: tuple[int, int]
    look: str
    action_repeat: int | None
    domain: str | Mapping[str, object]


class TaskSettings(CupTaskSettings, total=False):
    """What tasks take whose actor has grippers.

    num_pickers: number of pickers; None for 2, or 1 for pixels. Not for arms.
    arms: number of arms, 1 or 2; None for 2. Only for arms.
    grasp: how arms hold: "attach" or "friction"; None for "attach". Only for arms.
    """

    num_pickers: int | None
    arms: int | None
    grasp: str | None


class ClothTaskSettings(TaskSettings, total=False):
    """What tasks on cloth take.

    count_intersections: adds "intersections" to info: where the cloth passes through itself.
    """

    count_intersections: bool
