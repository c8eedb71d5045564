"""Settings of methods by name, a file each."""

import pathlib
import tomllib
from typing import Any

from softgym_mj.exceptions import check_name
from softgym_mj.learning.sac import SACSettings
from softgym_mj.learning.training import TrainingSettings

METHODS = ("sac",)


def find_preset(
    method: str, preset: str, task: str, **training: Any
) -> tuple[TrainingSettings, SACSettings]:
    """What a method learns, and how, by a preset.

    Args:
        method: one of `METHODS`.
        preset: of the method's file: "paper" or "fast".
        task: its name.
        **training: of `TrainingSettings`, in place of the preset's.

    Raises:
        InvalidArgumentError: for a name that there is not, or a bad value.
    """
    check_name("method", method, METHODS)
    file = pathlib.Path(__file__).with_name(f"{method}.toml")
    presets = tomllib.loads(file.read_text())
    check_name("preset", preset, presets)
    found = presets[preset]
    own = found.get("tasks", {}).get(task, {})
    settings = {**found["training"], **own.get("training", {}), **training}
    learner = {**found["learner"], **own.get("learner", {})}
    learner["hidden"] = tuple(learner["hidden"])
    return TrainingSettings(task, **settings), SACSettings(**learner)
