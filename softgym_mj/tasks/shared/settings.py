"""Keyword arguments that the tasks share and take as `**settings`."""

from collections.abc import Mapping, Sequence
from typing import TypedDict

from softgym_mj.robots.base import Actor


class CupTaskSettings(TypedDict, total=False):
    """Keyword arguments of all tasks; tasks on water have no others in `**settings`.

    actor: name of the actor, one of `actors` of the task's class (the first is the default), or an
        `Actor`.
    visual: appearance of arms: "primitive" (or None) for simple shapes, "menagerie" for the meshes
        of MuJoCo Menagerie. Only for arms.
    observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
    image_size: (height, width) of images [pixels].
    goal_marks: whether "rgb", "external_rgb" and "wrist_rgb" show the marks of the goal that
        `render` draws; depths, labels and point clouds never do. None for the tasks whose goal
        depends on the variation and shows by marks only. Tasks without marks reject True.
    look: rendering detail: "fast", or "paper" for people; a name in `rendering.look.LOOKS`. It
        affects images only.
    action_repeat: sim steps of 0.01 s per env step; None for the task's default.
    domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
        "out_of_distribution", "fabrics" as they occur, or a dict of parameters, as in
        `DomainRandomization`.
    """

    actor: str | Actor | None
    visual: str | None
    observation: str | Sequence[str]
    image_size: tuple[int, int]
    goal_marks: bool | None
    look: str
    action_repeat: int | None
    domain: str | Mapping[str, object]


class TaskSettings(CupTaskSettings, total=False):
    """Keyword arguments of tasks with grippers, in addition to those of `CupTaskSettings`.

    num_pickers: number of pickers; None for 2, or 1 for pixels. Not for arms.
    arms: number of arms, 1 or 2; None for 2. Only for arms.
    grasp: how arms hold: "attach" or "friction"; None for "attach". Only for arms.
    action: meaning of the entries of arms' actions: "position", "pose" or "joints"; None for
        "position". Only for arms.
    """

    num_pickers: int | None
    arms: int | None
    grasp: str | None
    action: str | None


class ClothTaskSettings(TaskSettings, total=False):
    """Keyword arguments of tasks on cloth, in addition to those of `TaskSettings`.

    count_intersections: adds "intersections" to info: the number of self-intersections.
    """

    count_intersections: bool
