"""The tasks: one frozen record each, by name."""

import dataclasses
import importlib
import inspect
import re
import typing
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import gymnasium

from softgym_mj.exceptions import (
    InvalidArgumentError,
    UnexpectedArgumentError,
    check_count,
    check_name,
)

if TYPE_CHECKING:
    from softgym_mj.tasks.shared.base import DeformableTask


@dataclasses.dataclass(frozen=True, eq=False)
class TaskRecord:
    """A task; one that is registered again is another one.

    Attributes:
        name: snake_case name.
        constructor: what builds the task from keyword arguments, or "module:function".
        tags: difficulty and kind of object.
        horizon: env steps in an episode.
        action_repeat: sim steps of 0.01 s per env step.
        summary: what is to be done.
    """

    name: str
    constructor: "str | Callable[..., DeformableTask]"
    tags: tuple[str, ...]
    horizon: int
    action_repeat: int
    summary: str

    @property
    def gymnasium_id(self) -> str:
        """Gymnasium id, "softgym_mj/SpreadCloth-v0" for "spread_cloth"."""
        return f"softgym_mj/{''.join(word.title() for word in self.name.split('_'))}-v0"

    @property
    def is_custom(self) -> bool:
        """Whether it is registered by somebody else than this package."""
        return self.name not in _SHIPPED

    def resolve(self) -> Callable[..., "DeformableTask"]:
        """The constructor; imports its module."""
        if not isinstance(self.constructor, str):
            return self.constructor
        module, function = self.constructor.split(":")
        return getattr(importlib.import_module(module), function)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the constructor's keyword arguments, those of the actor included."""
        names: list[str] = []
        for parameter in inspect.signature(self.resolve(), eval_str=True).parameters.values():
            if parameter.kind is inspect.Parameter.VAR_KEYWORD:
                names += typing.get_type_hints(_unpacked(parameter))
            else:
                names.append(parameter.name)
        return tuple(names)

    def check_arguments(self, names: Iterable[str], others: Sequence[str] = ()) -> None:
        """Raises unless all names are the constructor's.

        Args:
            names: of keyword arguments.
            others: names that the caller takes besides, for the message.

        Raises:
            UnexpectedArgumentError: for another name.
        """
        for key in names:
            if key not in self.arguments:
                choices = ", ".join(repr(name) for name in (*self.arguments, *others))
                raise UnexpectedArgumentError(
                    f"{self.name} got an unexpected keyword argument {key!r}; "
                    f"valid choices: {choices}."
                )

    def build(self, **task_kwargs) -> "DeformableTask":
        """Builds the task; an unknown keyword argument is an `UnexpectedArgumentError`."""
        self.check_arguments(task_kwargs)
        return self.resolve()(**task_kwargs)


def _unpacked(parameter: inspect.Parameter) -> type:
    """The TypedDict that names what a parameter such as `**settings` takes.

    Raises:
        InvalidArgumentError: if the parameter is not annotated with one.
    """
    if typing.get_origin(parameter.annotation) is not typing.Unpack:
        valid = (
            "keyword arguments with names: annotate it with a TypedDict, for example "
            f"**{parameter.name}: Unpack[softgym_mj.tasks.shared.base.TaskSettings]"
        )
        raise InvalidArgumentError("constructor", f"...(**{parameter.name})", valid)
    return typing.get_args(parameter.annotation)[0]


TASKS = {
    record.name: record
    for record in (
        TaskRecord(
            "transport_water",
            "softgym_mj.tasks.transport_water:transport_water",
            ("medium", "water"),
            horizon=75,
            action_repeat=8,
            summary="Move a cup of water to a place without spilling.",
        ),
        TaskRecord(
            "pour_water",
            "softgym_mj.tasks.pour_water:pour_water",
            ("medium", "water"),
            horizon=100,
            action_repeat=8,
            summary="Pour the water of one cup into another.",
        ),
        TaskRecord(
            "straighten_rope",
            "softgym_mj.tasks.straighten_rope:straighten_rope",
            ("medium", "rope"),
            horizon=75,
            action_repeat=8,
            summary="Pull the ends of a twisted rope apart until it is straight.",
        ),
        TaskRecord(
            "spread_cloth",
            "softgym_mj.tasks.spread_cloth:spread_cloth",
            ("medium", "cloth"),
            horizon=100,
            action_repeat=8,
            summary="Spread a crumpled cloth on the floor.",
        ),
        TaskRecord(
            "fold_cloth",
            "softgym_mj.tasks.fold_cloth:fold_cloth",
            ("medium", "cloth"),
            horizon=100,
            action_repeat=8,
            summary="Fold a flat cloth in half.",
        ),
        TaskRecord(
            "drop_cloth",
            "softgym_mj.tasks.drop_cloth:drop_cloth",
            ("medium", "cloth"),
            horizon=30,
            action_repeat=16,
            summary="Drop a hanging cloth so that it lies flat in its place.",
        ),
        TaskRecord(
            "pour_water_amount",
            "softgym_mj.tasks.pour_water:pour_water_amount",
            ("hard", "water"),
            horizon=100,
            action_repeat=8,
            summary="Pour a given share of the water of one cup into another.",
        ),
        TaskRecord(
            "fold_crumpled_cloth",
            "softgym_mj.tasks.fold_cloth:fold_crumpled_cloth",
            ("hard", "cloth"),
            horizon=100,
            action_repeat=8,
            summary="Spread a crumpled cloth, then fold it in half.",
        ),
        TaskRecord(
            "drop_fold_cloth",
            "softgym_mj.tasks.drop_cloth:drop_fold_cloth",
            ("hard", "cloth"),
            horizon=100,
            action_repeat=8,
            summary="Drop a hanging cloth so that it lies folded in half.",
        ),
        TaskRecord(
            "rope_configuration",
            "softgym_mj.tasks.rope_configuration:rope_configuration",
            ("hard", "rope"),
            horizon=100,
            action_repeat=8,
            summary="Lay a rope in the shape of a letter.",
        ),
    )
}


_SHIPPED = frozenset(TASKS)
_NAME = re.compile("[a-z][a-z0-9]*(_[a-z0-9]+)*")


def register(
    name: str,
    constructor: "Callable[..., DeformableTask]",
    *,
    horizon: int,
    tags: Sequence[str] = ("own",),
    action_repeat: int = 8,
    summary: str = "",
) -> TaskRecord:
    """Adds a task of your own to `TASKS`, Gymnasium's registry and dm_control's suite.

    In this process; what is registered by this name is replaced, but no task of the package.

    Args:
        name: snake_case name: "soak_cloth" becomes "softgym_mj/SoakCloth-v0".
        constructor: class or function that builds the task from keyword arguments. Those that it
            passes on as `**settings` have to be named: `**settings: Unpack[TaskSettings]`, with
            the `TaskSettings` of `softgym_mj.tasks.shared.base` or another TypedDict.
        horizon: env steps in an episode, 1 or more.
        tags: words to find it by in dm_control's suite.
        action_repeat: sim steps of 0.01 s per env step that it has by default.
        summary: what is to be done.

    Returns:
        Its record.

    Raises:
        InvalidArgumentError: for a bad name, constructor, horizon or action_repeat.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        valid = "lower-case words joined by underscores, such as 'soak_cloth'"
        raise InvalidArgumentError("name", name, valid)
    if name in _SHIPPED:
        raise InvalidArgumentError(
            "name", name, f"none of the package's: {', '.join(sorted(_SHIPPED))}"
        )
    if not callable(constructor):
        raise InvalidArgumentError(
            "constructor", constructor, "a class or function that builds a task"
        )
    check_count("horizon", horizon, 1)
    check_count("action_repeat", action_repeat, 1)
    record = TaskRecord(name, constructor, tuple(tags), horizon, action_repeat, summary)
    _ = record.arguments  # Fails if they have no names.
    TASKS[name] = record
    add_gymnasium_ids()
    return record


def add_gymnasium_ids() -> None:
    """Registers one id per task, for `make` and `make_vec`.

    The environment class is imported only when one is made. Its time limit is its own `horizon`.
    """
    for record in TASKS.values():
        if record.gymnasium_id not in gymnasium.registry:
            gymnasium.register(
                id=record.gymnasium_id,
                entry_point="softgym_mj.envs.gymnasium_env:SoftGymEnv",
                vector_entry_point="softgym_mj.vector.make:make_vec",
                kwargs={"task": record.name},
            )


def find(task: str | TaskRecord) -> TaskRecord:
    """The record of a task.

    Args:
        task: task name, one of `TASKS`; "module:name" for a task of your own, whose module is
            imported first so that it calls `register`; or a record, which is returned.

    Raises:
        InvalidArgumentError: if there is no such task; if the module cannot be imported or
            registers no task.
    """
    if isinstance(task, TaskRecord):
        return task
    if not isinstance(task, str) or ":" not in task:
        check_name("task", task, (*TASKS, "MODULE:NAME"))
        return TASKS[task]
    module, name = task.split(":", 1)
    try:
        imported = importlib.import_module(module)
    except Exception as error:  # Whatever the code of the module raises.
        raise InvalidArgumentError(
            f"task={task!r}: {module!r} cannot be imported: {type(error).__name__}: {error}; "
            f"`python -c 'import {module}'` has to work"
        ) from error
    if name not in TASKS:
        own = [f"{module}:{other}" for other in TASKS if other not in _SHIPPED]
        if own:
            raise InvalidArgumentError("task", task, own)
        raise InvalidArgumentError(
            f"task={task!r}: {imported!r} registers no task when it is imported; call "
            "softgym_mj.register in it, not below `if __name__ == '__main__'`"
        )
    return TASKS[name]
