"""Entries of states: numbers with a name, kind and unit, and those that several tasks list.

Labels of data sheets and symmetries follow from the entries of a task.
"""

from collections.abc import Mapping
from typing import NamedTuple

from softgym_mj import metrics
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import Episode, State


class Entry(NamedTuple):
    """Numbers of a state.

    Attributes:
        values: numbers (..., n); a point (..., 3) or points (..., k, 3) in the world [m].
        kind: "numbers", "point" or "points".
        unit: unit of all numbers; "" without one.
        role: owner of the points: the "object", in its order, a "goal" or "other".
    """

    values: Array
    kind: str = "numbers"
    unit: str = ""
    role: str = "other"


Entries = Mapping[str, Entry]  # By name.
_EACH = {"numbers": "", "point": " (x, y, z)", "points": " (x, y, z each)"}
ROLES = "object", "goal", "other"


def numbers(values: Array, unit: str = "") -> Entry:
    """Returns an entry of numbers (..., n)."""
    return Entry(values, unit=unit)


def point(values: Array, role: str = "other") -> Entry:
    """Returns an entry of a point (..., 3) [m]."""
    return Entry(values, "point", "m", role)


def points(values: Array, role: str = "other") -> Entry:
    """Returns an entry of points (..., k, 3) [m]."""
    return Entry(values, "points", "m", role)


def values(method: str, entries: Entries) -> list[Array]:
    """Returns the values of the entries that a task's method lists.

    Raises:
        InvalidArgumentError: for an item that is no entry, or an entry whose values are no array.
    """
    if not isinstance(entries, Mapping):
        raise InvalidArgumentError(f"{method}()", entries, "a dict from names to entries")
    for name, entry in entries.items():
        if not isinstance(entry, Entry):
            valid = "an entry: `numbers`, `point` or `points` of softgym_mj.tasks"
            raise InvalidArgumentError(f"{method}()[{name!r}]", entry, valid)
        if not hasattr(entry.values, "shape"):
            raise InvalidArgumentError(f"{method}()[{name!r}]", entry.values, "an array")
    return [entry.values for entry in entries.values()]


def labels(entries: Entries) -> dict[str, Array]:
    """Returns values by label: "corner p1 (x, y, z) [m]"."""
    return {
        f"{name}{_EACH[entry.kind]}{f' [{entry.unit}]' if entry.unit else ''}": entry.values
        for name, entry in entries.items()
    }


def corners(state: State, episode: Episode) -> dict[str, Entry]:
    """Returns the corners of the cloth in the order of `Cloth.corners`."""
    found = metrics.taken(state.points["cloth"], episode.shapes["cloth"]["corners"])
    return {f"corner p{i + 1}": point(found[..., i, :], "object") for i in range(4)}


def key_points(state: State, episode: Episode) -> dict[str, Entry]:
    """Returns evenly spaced vertices of the cloth, row by row."""
    found = metrics.taken(state.points["cloth"], episode.shapes["cloth"]["key_points"])
    return {"key points": points(found, "object")}


def cup(name: str, state: State, episode: Episode) -> dict[str, Entry]:
    """Returns a cup's pose and inner size."""
    pose, size = state.poses[name], episode.shapes[name]["size"]
    return {
        f"{name} x, z": numbers(pose[..., :3:2], "m"),
        f"{name} theta": numbers(pose[..., 7:], "rad"),
        f"{name} inner length, width, height": numbers(size[..., :3], "m"),
    }


def cups(state: State, episode: Episode) -> dict[str, Entry]:
    """Returns the poses and inner sizes of all cups."""
    each = (cup(name, state, episode) for name in state.poses)
    return {name: entry for entries in each for name, entry in entries.items()}


def highest_particle(state: State) -> dict[str, Entry]:
    """Returns the height of the highest particle, how high the water splashes."""
    top = metrics.highest(state.points["water"], state.present["water"])
    return {"height of the highest particle": numbers(top[..., None], "m")}
