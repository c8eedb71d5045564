"""Methods by name: settings, and what makes a learner of them.

Each is a module of the folder `methods` with a dataclass of settings and a function `make(settings,
problem)`, and a file of presets.
"""

import dataclasses
import importlib
import pathlib
import tomllib
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.learning.learner import Method
from softgym_mj.learning.settings import TrainingSettings

# Module and class of the settings.
METHODS = {
    "sac": ("sac", "StateSACSettings"),
    "sac_hindsight": ("hindsight", "HindsightSettings"),
    "sac_points": ("point_sets", "PointSetSettings"),
    "tdmpc2": ("tdmpc2.learner", "TDMPC2Settings"),
    "bc": ("bc", "BCSettings"),
    "rlpd": ("rlpd", "RLPDSettings"),
    "planet": ("planet.learner", "PlaNetSettings"),
    "ppo": ("ppo.learner", "PPOSettings"),
    "wu": ("wu.learner", "WuSettings"),
    "curl": ("curl", "CURLSettings"),
    "drq": ("drq", "DrQSettings"),
}
PRESETS = pathlib.Path(__file__).parent / "methods" / "presets"  # A file of each method.
_ROOM = "softgym_mj.learning.methods"
LARGEST_LAYER, LARGEST_BATCH = 16_384, 1_000_000
LABELLED = {"observation", "symmetric"}  # Settings that curves name beside the preset.


def find_method(name: str, /, **settings: Any) -> Method:
    """A method with settings of one's own.

    Args:
        name: one of `METHODS`.
        **settings: of its dataclass.

    Raises:
        InvalidArgumentError: for a name that there is not, or a bad value.
    """
    check_name("method", name, METHODS)
    module, kind = METHODS[name]
    found = importlib.import_module(f"{_ROOM}.{module}")
    made = getattr(found, kind)(**settings)
    _check_sizes(made)
    return Method(name, "custom", made, found.make)


def find_preset(
    name: str, preset: str, task: str, /, **replaced: Any
) -> tuple[TrainingSettings, Method]:
    """What a method learns, and how, by a preset of its file.

    A preset may have settings of its own for a task, and for an observation that is not its first.

    Args:
        name: one of `METHODS`.
        preset: of the method's file, such as "paper" or "fast".
        task: its name.
        **replaced: settings of the training or the method in place of the preset's.

    Raises:
        InvalidArgumentError: for a name that there is not, or a bad value.
    """
    check_name("method", name, METHODS)
    presets = tomllib.loads((PRESETS / f"{name}.toml").read_text())
    check_name("preset", preset, presets)
    whole = presets[preset]
    seen = whole.get("observations", {}).get(str(replaced.get("observation")), {})
    layers = (whole, _own(whole, task), seen, _own(seen, task))  # Later ones count.
    found = {
        part: {key: value for layer in layers for key, value in layer.get(part, {}).items()}
        for part in ("training", "method")
    }
    module, kind = METHODS[name]
    fields = getattr(importlib.import_module(f"{_ROOM}.{module}"), kind)
    names = {
        "training": {field.name for field in dataclasses.fields(TrainingSettings)} - {"task"},
        "method": {field.name for field in dataclasses.fields(fields)},
    }
    for key, value in replaced.items():
        parts = [part for part in names if key in names[part]]
        if not parts:
            raise InvalidArgumentError("settings", key, sorted(names["training"] | names["method"]))
        found[parts[0]][key] = value
    method = find_method(name, **{key: _tuples(value) for key, value in found["method"].items()})
    named = preset if LABELLED.issuperset(replaced) else "custom"
    return TrainingSettings(task, **found["training"]), dataclasses.replace(method, preset=named)


def _check_sizes(settings: Any) -> None:
    """Raises `InvalidArgumentError` for layers or batches that no network can have."""
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if field.type == tuple[int, ...]:
            for size in value:
                check_count(field.name, size, 1, LARGEST_LAYER)
        elif field.name == "batch":
            check_count(field.name, value, 1, LARGEST_BATCH)


def _own(preset: dict[str, Any], task: str) -> dict[str, Any]:
    return preset.get("tasks", {}).get(task, {})


def _tuples(value: Any) -> Any:
    """Lists of TOML and JSON as settings have them."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
