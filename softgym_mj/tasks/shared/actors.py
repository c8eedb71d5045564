"""The actor of a task, from what its class and the user say."""

from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.robots.base import Actor
from softgym_mj.robots.cup_mover import CupTool
from softgym_mj.robots.factory import make_actor

MOST_REPEATED = 1000  # Sim steps of an env step: ten seconds.


def make(
    task_class: Any, actor: str | Actor | None, tool: CupTool | None, settings: Mapping[str, Any]
) -> Any:
    """Builds the actor.

    Args:
        task_class: with `actors`, `material` and `arm_height` of `Task`.
        actor: one of these actors, None for the first of them, or what is returned as it is.
        tool: a cup for it to move; None for grippers.
        settings: as in `make_actor`.

    Raises:
        InvalidArgumentError: if there is no such actor, or a setting is not for it.
    """
    if isinstance(actor, Actor):
        return actor
    name = task_class.actors[0] if actor is None else actor
    check_name("actor", name, task_class.actors)
    if tool is not None:
        return make_actor(name, tool, **settings)
    return make_actor(name, task_class.material, base_height=task_class.arm_height, **settings)


def checked_repeat(actor: Actor, action_repeat: int | None, usual: int) -> int:
    """Sim steps for which an action is repeated: 1 if it takes as long as it needs.

    Args:
        actor: what acts.
        action_repeat: what the user wants; None for the usual number.
        usual: that of the task.

    Raises:
        InvalidArgumentError: if there cannot be as many.
    """
    if actor.sim_steps is None:
        repeat = usual if action_repeat is None else action_repeat
        return check_count("action_repeat", repeat, 1, MOST_REPEATED)
    if action_repeat not in (None, 1):
        raise InvalidArgumentError("action_repeat", action_repeat, f"1 with actor={actor.name!r}")
    return 1
