"""`load`: from the name of a task to its environment."""

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from softgym_mj.registry import TaskRecord, find

if TYPE_CHECKING:
    import numpy as np

    from softgym_mj.envs.environment import Environment
    from softgym_mj.tasks.shared.base import Task


def load(
    task: str | TaskRecord,
    /,
    *,
    split: str | Sequence[int] = "train",
    horizon: int | None = None,
    random_state: "int | np.random.RandomState | None" = None,
    **task_kwargs,
) -> "Environment":
    """Builds the dm_env environment of a task.

    Args:
        task: task name, one of `TASKS`, "module:name" of a custom task, or a record.
        split: "train" (variations 0..799), "evaluate" (800..999), "all" or a sequence of indices.
        horizon: env steps in an episode; None for the task's own, or 20 with pick-and-place
            actions.
        random_state: seed or generator that draws the variations.
        **task_kwargs: keyword arguments of the task's constructor, such as `observation`.
            `TASKS[task].arguments` lists them; `help(TASKS[task].resolve())` explains a task's own,
            `help("softgym_mj.tasks.shared.settings")` those that tasks share. Snapshots of a custom
            task fit only with the same arguments, except for observations.

    Returns:
        The environment; actions are (n,) in [-1, 1], observations arrays by name. A copy or a
        pickle of it continues the episode.

    Raises:
        InvalidArgumentError: for a bad value; if there is no such task.
        UnexpectedArgumentError: for an unknown keyword argument.
    """
    record = find(task)
    from softgym_mj.envs.environment import Environment
    from softgym_mj.tasks.shared.arguments import arguments_of_states

    record.check_arguments(task_kwargs, load)
    built = record.build(**task_kwargs)
    built.arguments = arguments_of_states(record.resolve(), task_kwargs)
    if horizon is None:
        horizon = _default_horizon(record, built)
    env = Environment(
        built, name=record.name, horizon=horizon, split=split, random_state=random_state
    )
    env.maker = functools.partial(load, record, split=split, horizon=horizon, **task_kwargs)
    return env


def horizon_of(task: str | TaskRecord, settings: Mapping[str, Any]) -> int:
    """Returns the env steps in an episode of `load(task, **settings)`, without an environment.

    Unknown arguments are ignored, because results of earlier versions have some.
    """
    if (horizon := settings.get("horizon")) is not None:
        return horizon
    record = find(task)
    known = {name: value for name, value in settings.items() if name in record.arguments}
    return _default_horizon(record, record.build(**known))


def _default_horizon(record: TaskRecord, built: "Task") -> int:
    """Returns the env steps in an episode of a task: the actor's, if it has its own."""
    return built.actor.horizon or record.horizon
