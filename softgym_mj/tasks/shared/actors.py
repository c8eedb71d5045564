"""Actor of a task, from its class and the user's settings."""

from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name, choices
from softgym_mj.robots.base import Actor
from softgym_mj.robots.cup_mover import CupTool
from softgym_mj.robots.factory import CUP_ACTORS, GRIPPERS, make_actor

MOST_REPEATED = 1000  # [sim steps] Longest env step: 10 s.


def make(
    task_class: Any, actor: str | Actor | None, tool: CupTool | None, settings: Mapping[str, Any]
) -> Any:
    """Builds the actor.

    Args:
        task_class: class with `actors`, `material` and `arm_height` of `Task`.
        actor: name of one of these actors, None for the first; an `Actor` is returned as it is.
        tool: cup that it moves; None for grippers.
        settings: as in `make_actor`.

    Raises:
        InvalidArgumentError: for an unknown actor or a setting that it does not have.
    """
    if isinstance(actor, Actor):
        return actor
    name = task_class.actors[0] if actor is None else actor
    if name in (*GRIPPERS, *CUP_ACTORS) and name not in task_class.actors:
        others = choices(name, task_class.actors)
        raise InvalidArgumentError(f"{task_class.__name__} has no actor={name!r}{others}")
    check_name("actor", name, task_class.actors)
    if tool is not None:
        return make_actor(name, tool, **settings)
    return make_actor(name, task_class.material, base_height=task_class.arm_height, **settings)


def checked_repeat(actor: Actor, action_repeat: int | None, usual: int) -> int:
    """Returns the number of sim steps of an env step; 1 if an action takes as long as it needs.

    Args:
        actor: the actor.
        action_repeat: number that the user set; None for the usual one.
        usual: number of the task.

    Raises:
        InvalidArgumentError: if the number is not possible.
    """
    if actor.sim_steps is None:
        repeat = usual if action_repeat is None else action_repeat
        return check_count("action_repeat", repeat, 1, MOST_REPEATED)
    if action_repeat not in (None, 1):
        raise InvalidArgumentError("action_repeat", action_repeat, f"1 with actor={actor.name!r}")
    return 1
