"""The tasks, a file each; `shared` is what they are made of."""

from softgym_mj.metrics import Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import numbers, point, points
from softgym_mj.tasks.shared.settings import ClothTaskSettings, CupTaskSettings, TaskSettings
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere, mirrored

__all__ = [
    "ClothTaskSettings",
    "CupTaskSettings",
    "Episode",
    "Measures",
    "State",
    "Task",
    "TaskSettings",
    "ToolStart",
    "Workspace",
    "anywhere",
    "mirrored",
    "numbers",
    "point",
    "points",
]
