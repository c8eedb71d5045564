"""The tasks, and what they are made of."""

from softgym_mj.metrics import Measures
from softgym_mj.tasks.scene_task import SceneTask
from softgym_mj.tasks.shared.base import DeformableTask, TaskSettings
from softgym_mj.tasks.shared.state import Episode, State

__all__ = ["DeformableTask", "Episode", "Measures", "SceneTask", "State", "TaskSettings"]
