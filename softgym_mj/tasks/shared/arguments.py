"""Arguments of a task that must agree for a snapshot to fit."""

import inspect
import json
from collections.abc import Callable, Mapping

# Arguments that only affect observations, or are part of every snapshot's key.
NOT_OF_STATES = (
    "observation", "image_size", "goal_marks", "look", "visual", "action_repeat", "domain", "actor",
    "num_pickers", "arms", "grasp", "action", "count_intersections",
)  # fmt: skip


def arguments_of_states(
    constructor: Callable[..., object], task_kwargs: Mapping[str, object]
) -> dict[str, str]:
    """Returns the task arguments that must agree for a snapshot to fit another environment.

    Args:
        constructor: builds the task.
        task_kwargs: its keyword arguments.

    Returns:
        Arguments that differ from their defaults, as JSON; those that JSON cannot represent and
        `NOT_OF_STATES` are left out.
    """
    parameters = inspect.signature(constructor).parameters
    found = {}
    for name in sorted(set(task_kwargs) - set(NOT_OF_STATES)):
        default = parameters[name].default if name in parameters else None
        text = _as_json(task_kwargs[name])
        if text is not None and text != _as_json(default):
            found[name] = text
    return found


def _as_json(value: object) -> str | None:
    """Returns a value as JSON; None if JSON cannot represent it."""
    try:
        return json.dumps(value, sort_keys=True)
    except (TypeError, ValueError):
        return None
