"""Validation of a custom task: its objects, class attributes and return values."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.fluid import Water
from softgym_mj.metrics import Measures
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.workspace import Workspace
from softgym_mj.tasks.shared import entries as listed
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.symmetry import Turned
from softgym_mj.validation import as_array, as_finite

_NUMBERS = (float, int, np.floating, np.integer, np.bool_)  # A bool is an int.
# Reserved names in info; other groups have a prefix.
INFO_NAMES = frozenset(
    (
        "performance", "normalized_performance", "success", "is_success", "variation",
        "physics_warnings", "diverged", "cameras",
    )
)  # fmt: skip
_INFO_PREFIXES = ("reward_", "domain_")
SUNK = 1e-3  # [m] Tolerance for points below the floor at the start: resting points lie above it.


def check_objects(objects: object, has_tool: bool) -> None:
    """Raises `InvalidArgumentError` unless the objects are valid and the actor can act on one."""
    if not isinstance(objects, Sequence) or not all(
        isinstance(thing, Flex | Water | Cup) for thing in objects
    ):
        valid = "a list of ropes, cloths, garments, waters and cups"
        raise InvalidArgumentError("objects", objects, valid)
    if not has_tool and not any(isinstance(thing, Flex) for thing in objects):
        raise InvalidArgumentError("objects", objects, "at least one rope, cloth or garment")
    names = [thing.mjcf_model.model for thing in objects]
    if len(set(names)) < len(names):
        raise InvalidArgumentError("objects", names, "a different `name` for each of them")


def check_workspace(workspace: object) -> None:
    """Raises `InvalidArgumentError` unless it is a `Workspace`."""
    if not isinstance(workspace, Workspace):
        raise InvalidArgumentError("workspace", workspace, "a Workspace((x, y, z), (x, y, z))")


def check_symmetries(symmetries: object) -> None:
    """Raises `InvalidArgumentError` unless it is a sequence of `Turned`."""
    turns = symmetries if isinstance(symmetries, Sequence) else [symmetries]
    if not all(isinstance(each, Turned) for each in turns):
        valid = "what `anywhere` or `mirrored` of softgym_mj.tasks returns: anywhere('same')"
        raise InvalidArgumentError("symmetries", symmetries, valid)


def checked_timestep(timestep: float | None, objects: Iterable[Flex | Water]) -> float:
    """Returns the physics step [s], if it suits the objects and divides a sim step."""
    largest = min(thing.timestep for thing in objects)
    if timestep is None:
        return largest
    whole = 0.0 < timestep <= largest and np.isclose(SIM_STEP / timestep % 1.0, [0.0, 1.0]).any()
    if not whole:
        raise InvalidArgumentError("timestep", timestep, f"{SIM_STEP} s / n, at most {largest} s")
    return timestep


def check_points(points: Mapping[str, np.ndarray], arena: Arena) -> None:
    """Raises `InvalidArgumentError` if an object starts below the floor, if there is one.

    Args:
        points: (n, 3) [m] of each object by name.
        arena: the arena.
    """
    floor = arena.mjcf_model.find("geom", "floor")
    lowest = -np.inf if floor is None else (0.0 if floor.pos is None else floor.pos[2]) - SUNK
    for name, array in points.items():
        if not np.isfinite(array).all():
            raise InvalidArgumentError(f"points of {name!r}", array.shape, "finite array")
        height = float(array[:, 2].min())
        if height < lowest:
            valid = "on the floor or above it [m]: `arrange` puts it there"
            raise InvalidArgumentError(f"lowest point of {name!r}", height, valid)


def check_bounds(bounds: object) -> None:
    """Raises `InvalidArgumentError` unless these are two finite numbers in ascending order."""
    found = np.asarray(bounds, float)
    if found.shape != (2,) or not np.isfinite(found).all() or found[0] >= found[1]:
        raise InvalidArgumentError("bounds()", bounds, "(lower, upper) with lower < upper")


def check_goal(goal: Mapping[str, object]) -> None:
    """Raises `InvalidArgumentError` unless a goal consists of finite numbers, or bools."""
    for name, value in goal.items():
        if as_array(f"goal()[{name!r}]", value).dtype != bool:
            as_finite(f"goal()[{name!r}]", value)


def check_entries(method: str, entries: Entries) -> None:
    """Raises `InvalidArgumentError` for entries of the wrong shape or role, or not finite."""
    for (name, entry), found in zip(entries.items(), listed.values(method, entries), strict=True):
        check_name(f"role of {method}()[{name!r}]", entry.role, listed.ROLES)
        array = np.asarray(found, float)
        shaped = {
            "numbers": array.ndim == 1,
            "point": array.shape == (3,),
            "points": array.ndim == 2 and array.shape[1] == 3,
        }
        if not shaped[entry.kind] or not np.isfinite(array).all():
            valid = "finite numbers (n,), a point (3,) or points (k, 3)"
            raise InvalidArgumentError(f"{method}()[{name!r}]", array, valid)


_MEASURES = "`Measures`: return Measures(performance, {name: reward})"  # A function's value.


def checked(measures: object) -> Measures:
    """Returns the measures of one simulation as Python numbers.

    Raises:
        InvalidArgumentError: for a value that is no number or not finite, or a reserved name: one
            of `INFO_NAMES`, or one that begins with "reward_" or "domain_".
    """
    if not isinstance(measures, Measures):
        raise InvalidArgumentError("measure()", measures, _MEASURES)
    groups = {"rewards": measures.rewards, "info": measures.info}
    for group, values in groups.items():
        if not isinstance(values, dict):
            raise InvalidArgumentError(group, values, "a dict from names to numbers")
    for name in measures.info:
        if not isinstance(name, str) or name in INFO_NAMES or name.startswith(_INFO_PREFIXES):
            taken = ", ".join(sorted(INFO_NAMES))
            valid = f"a name without the prefix reward_ or domain_, and none of {taken}"
            raise InvalidArgumentError("info", name, valid)
    return Measures(
        _number("performance", measures.performance, finite=True),
        {k: _number(f"rewards[{k!r}]", v, finite=True) for k, v in measures.rewards.items()},
        {k: _number(f"info[{k!r}]", v, finite=False) for k, v in measures.info.items()},
    )


def _number(name: str, value: object, finite: bool) -> float | int | bool:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not isinstance(value, _NUMBERS) or (finite and not math.isfinite(value)):
        valid = "a finite number" if finite else "a number"
        if isinstance(value, np.ndarray):
            raise InvalidArgumentError(f"{name} has shape {value.shape}: expected {valid}.")
        raise InvalidArgumentError(name, value, valid)
    return value.item() if isinstance(value, np.generic) else value


def check_names(groups: Iterable[Iterable[str]]) -> None:
    """Raises `InvalidArgumentError` for a name that occurs in two groups of info."""
    seen = set(INFO_NAMES)
    for group in groups:
        names = set(group)
        if twice := sorted(seen & names):
            raise InvalidArgumentError("measures or diagnostics", twice, "names without duplicates")
        seen |= names


def check_task(task: Any) -> None:
    """Raises `InvalidArgumentError` for bad names in the states or the info of a started task."""
    for method in ("reduced", "extra_state"):
        check_entries(method, getattr(task, method)(task.state(), task.episode))
    own, started = task.last_evaluation.info, task.episode_info(task.episode)
    others = task.last_secondary_metrics, task.diagnostics(), task.actor.diagnostics()
    check_names((own, started, *others))
