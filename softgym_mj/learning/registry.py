"""Learning methods by name, their settings and presets.

A method is a module of the folder `methods` with a dataclass of settings, a function
`make(settings, problem)` and a file of presets; or "module:function", a function of another module
whose first argument is annotated with the dataclass. That module may have `PRESETS`.
"""

import dataclasses
import importlib
import inspect
import pathlib
import tomllib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.learning.curves import named
from softgym_mj.learning.learner import Method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.policies.exported import has_images

# Module and class of the settings, by name.
METHODS = {
    "sac": ("sac", "StateSACSettings"),
    "tqc": ("tqc", "TQCSettings"),
    "planet": ("planet.learner", "PlaNetSettings"),
    "wu": ("wu.learner", "WuSettings"),
    "curl": ("curl", "CURLSettings"),
    "drq": ("drq", "DrQSettings"),
    "distill": ("distill", "DistillSettings"),
    "teacher_student": ("teacher_student", "TeacherStudentSettings"),
}
PRESETS = pathlib.Path(__file__).parent / "methods" / "presets"  # Folder with a file per method.
_ROOM = "softgym_mj.learning.methods"
LARGEST_LAYER, LARGEST_BATCH = 16_384, 1_000_000
# Settings that do not make a preset "custom": curves name them.
LABELED = {"actor", "observation", "symmetric", "teacher", "privileged"}
# Settings for symmetries, which only the default actors have.
_SYMMETRIC = {"symmetric", "symmetrize_policy"}


def find_method(name: str, /, **settings: Any) -> Method:
    """Returns a method with custom settings.

    Args:
        name: One of `METHODS`, or "module:function".
        **settings: Settings of the method's dataclass.

    Raises:
        InvalidArgumentError: for an unknown name or a bad value.
    """
    result = _find(name)
    made = result.settings(**settings)
    _check_sizes(made)
    return Method(name, "custom", made, result.make)


class _Found(NamedTuple):
    """Class of a method's settings, function that creates its learners, and presets by name."""

    settings: type
    make: Callable[..., Any]
    presets: Mapping[str, Any]


def _find(name: str) -> _Found:
    if isinstance(name, str) and ":" in name:
        return _imported(name)
    check_name("method", name, (*METHODS, "MODULE:FUNCTION"))
    module, kind = METHODS[name]
    result = importlib.import_module(f"{_ROOM}.{module}")
    presets = tomllib.loads((PRESETS / f"{name}.toml").read_text())
    return _Found(getattr(result, kind), result.make, presets)


def _imported(name: str) -> _Found:
    """Returns a method of a module outside of this package."""
    module_name, function = name.split(":", 1)
    try:
        module = importlib.import_module(module_name)
        make = getattr(module, function)
        first = next(iter(inspect.signature(make, eval_str=True).parameters.values())).annotation
    except Exception as error:  # The module's code may raise any error.
        raise InvalidArgumentError(
            f"method={name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    if not (isinstance(first, type) and dataclasses.is_dataclass(first)):
        valid = "a function make(settings: Settings, problem), Settings being a dataclass"
        raise InvalidArgumentError("method", name, valid)
    return _Found(first, make, getattr(module, "PRESETS", {"fast": {}}))


def preset_names(name: str) -> list[str]:
    """Returns the names of a method's presets; `name` as in `find_preset`."""
    return [*_find(name).presets]


def default_preset(name: str) -> str:
    """Returns the preset "fast" of a method, or the first of "minutes" and all that it has."""
    names = preset_names(name)
    return next(each for each in ("fast", "minutes", *names) if each in names)


def image_methods(task: str) -> list[str]:
    """Returns the names of the methods whose first preset observes images."""
    observed = {
        name: find_preset(name, preset_names(name)[0], task)[0].observations for name in METHODS
    }
    return [name for name in METHODS if has_images(observed[name])]


def find_preset(
    name: str, preset: str, task: str, /, **replaced: Any
) -> tuple[TrainingSettings, Method]:
    """Returns training settings and a method of a preset.

    A preset can have settings for single tasks and observations, and can be `based_on` another
    preset, some of whose settings it replaces.

    Args:
        name: One of `METHODS`, or "module:function".
        preset: Preset of the method, such as "paper" or "fast"; of a module, a key of its `PRESETS`
            or, if it has none, "fast" (the defaults).
        task: Task name.
        **replaced: Settings of the training or the method that replace the preset's. Without
            `part`, `env_steps` shorten it to their largest divisor, if that is not much shorter.
            An `actor` turns off symmetries, which only the default one has, unless set as well.

    Raises:
        InvalidArgumentError: for an unknown name or a bad value.
    """
    method_class, _, presets = _find(name)
    layers = _layers(presets, preset, task, named(replaced.get("observation")))
    result = {
        part: {key: value for layer in layers for key, value in layer.get(part, {}).items()}
        for part in ("training", "method")
    }
    defaults = {"training": _defaults(TrainingSettings, "task"), "method": _defaults(method_class)}
    changed = set()
    for key, value in replaced.items():
        parts = [part for part in defaults if key in defaults[part]]
        if not parts:
            valid = sorted({*defaults["training"], *defaults["method"]})
            raise InvalidArgumentError("settings", key, valid)
        own = result[parts[0]]
        if _tuples(own.get(key, defaults[parts[0]][key])) != _tuples(value):
            changed.add(key)
        own[key] = value
    if "part" not in replaced:
        _fit_part(result["training"])
    training = TrainingSettings(task, **result["training"])
    if training.actor is not None:
        without = _SYMMETRIC & defaults["method"].keys() - replaced.keys()
        result["method"] |= dict.fromkeys(without, False)
    method = find_method(name, **{key: _tuples(value) for key, value in result["method"].items()})
    label = preset if LABELED.issuperset(changed) else "custom"
    return training, dataclasses.replace(method, preset=label)


def _defaults(settings: type, *without: str) -> dict[str, Any]:
    """Returns the defaults of a dataclass by name."""
    fields = dataclasses.fields(settings)
    return {field.name: field.default for field in fields if field.name not in without}


def _fit_part(training: dict[str, Any]) -> None:
    """Shortens a part to the largest divisor of the env steps that is a multiple of num_envs.

    It stays as it is if less than half would be left, since each part ends with an evaluation, or
    for values of a wrong type; `TrainingSettings` then raises the error.
    """
    defaults = _defaults(TrainingSettings)
    values = (training.get(name, defaults[name]) for name in ("env_steps", "part", "num_envs"))
    env_steps, part, num_envs = values
    if not all(type(value) is int and value > 0 for value in (env_steps, part, num_envs)):
        return
    longest = min(part, env_steps)
    fitting = range(longest // num_envs * num_envs, longest // 2, -num_envs)
    training["part"] = next((size for size in fitting if env_steps % size == 0), part)


def _check_sizes(settings: Any) -> None:
    """Raises `InvalidArgumentError` for layers or batches that are too large."""
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if field.type == tuple[int, ...]:
            for size in value:
                check_count(field.name, size, 1, LARGEST_LAYER)
        elif field.name == "batch":
            check_count(field.name, value, 1, LARGEST_BATCH)


def _layers(
    presets: Mapping[str, Any], preset: str, task: str, observation: str | None
) -> list[dict[str, Any]]:
    """Returns parts of presets in order; later ones override earlier ones."""
    check_name("preset", preset, presets)
    whole = presets[preset]
    base = _layers(presets, whole["based_on"], task, observation) if "based_on" in whole else []
    seen = whole.get("observations", {}).get(observation, {})
    return [*base, whole, _own(whole, task), seen, _own(seen, task)]


def _own(preset: dict[str, Any], task: str) -> dict[str, Any]:
    return preset.get("tasks", {}).get(task, {})


def _tuples(value: Any) -> Any:
    """Converts lists of TOML and JSON to tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
