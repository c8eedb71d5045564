"""`Snapshot`: complete state of an episode, and checks that it fits an environment."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, SnapshotError, check_count
from softgym_mj.validation import check_type


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """Complete state on which the rest of an episode depends.

    Attributes:
        task_name: name of its task.
        key: `Task.snapshot_key` of that task.
        physics: mjSTATE_INTEGRATION vector of mjData.
        task: state of the task and its actor: variation, bounds, held vertices.
        step_count: env steps since reset.
        ended: whether the episode has ended.
        random_state: state of the environment's random generator.
    """

    task_name: str
    key: dict[str, object]
    physics: np.ndarray
    task: dict
    step_count: int
    ended: bool
    random_state: tuple


def check_origin(snapshot: Snapshot, task_name: str, key: Mapping[str, object]) -> None:
    """Raises `SnapshotError` unless a snapshot is of this task with these settings."""
    try:
        for field in dataclasses.fields(Snapshot):
            check_type(field.name, getattr(snapshot, field.name), field.type)
    except InvalidArgumentError as error:
        raise SnapshotError(f"the snapshot is damaged: {error}") from error
    if snapshot.task_name != task_name:
        raise SnapshotError(
            f"the snapshot is of task {snapshot.task_name!r}, the environment of {task_name!r}"
        )
    differ = [
        f"{name}={snapshot.key.get(name)!r} against {key.get(name)!r}"
        for name in {**snapshot.key, **key}
        if repr(snapshot.key.get(name)) != repr(key.get(name))
    ]
    if differ:
        raise SnapshotError(
            f"the snapshot is of an environment with other settings: {', '.join(differ)}"
        )


def check_content(snapshot: Snapshot, physics_size: int, own: Mapping[str, Any]) -> None:
    """Raises a ValueError unless a snapshot has the content of those of the running variation.

    Args:
        snapshot: snapshot of the same task with the same settings.
        physics_size: length of the physics vector.
        own: `Task.get_state` of the running variation.
    """
    check_count("step_count", snapshot.step_count, 0)
    state, size = snapshot.task, (physics_size,)
    if snapshot.physics.shape != size or not np.isfinite(snapshot.physics).all():
        raise ValueError(f"physics is expected to be {size} finite numbers")
    for name in ("initial_performance", "most_strained"):
        check_type(name, state[name], float)
    check_type("actor", state["actor"], Mapping[str, np.ndarray])
    shapes, expected = (
        {name: (a.shape, a.dtype.kind) for name, a in actor.items()}
        for actor in (state["actor"], own["actor"])
    )
    if shapes != expected or state.keys() != own.keys():
        raise ValueError(f"{[*state]}, {shapes}; expected {[*own]}, {expected}")
    np.random.RandomState(0).set_state(snapshot.random_state)
