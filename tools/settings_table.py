"""Table of the settings of `train sac`: meaning, and values of two presets."""

import dataclasses
import inspect
import json
import re
from typing import Any

from softgym_mj.learning.methods.sac import StateSACSettings
from softgym_mj.learning.registry import find_preset
from softgym_mj.learning.settings import TrainingSettings
from tools.pages import table

TASK, PRESETS = "straighten_rope", ("fast", "night")
# Settings with options of their own, and the preset's name.
_LEFT_OUT = {"task", "observation", "arguments", "actor", "preset"}


def meanings(settings: type) -> dict[str, str]:
    """Returns the meaning of each attribute, from the docstrings of a class and its bases."""
    found: dict[str, str] = {}
    for one in reversed(settings.__mro__[:-1]):
        text = inspect.getdoc(one) or ""
        part = re.search(r"Attributes:\n([\s\S]*?)(?:\n\n|$)", text)
        for entry in re.split(r"\n(?=    \w)", f"\n{part[1]}" if part else ""):
            names, _, meaning = " ".join(entry.split()).partition(": ")
            found.update(dict.fromkeys(names.split(", "), meaning.rstrip(".")))
    return found


def sac() -> str:
    """Returns the table of settings of the training, then of the method."""
    rows = []
    for position, kind in enumerate((TrainingSettings, StateSACSettings)):
        explained = meanings(kind)
        values: list[Any] = [find_preset("sac", preset, TASK)[position] for preset in PRESETS]
        if position:
            values = [method.settings for method in values]
        for field in dataclasses.fields(kind):
            if field.name not in _LEFT_OUT:
                shown = [json.dumps(getattr(value, field.name)) for value in values]
                cells = f"`{field.name}`", explained[field.name], *shown
                rows.append(f"| {' | '.join(cells)} |")
    return table(f"| setting | meaning | {' | '.join(PRESETS)} |", rows)
