"""The tasks, and what they are made of."""

from softgym_mj.tasks.base import DeformableTask, Entries, Evaluation, TaskSettings
from softgym_mj.tasks.scene_task import SceneTask

__all__ = ["DeformableTask", "Entries", "Evaluation", "SceneTask", "TaskSettings"]
