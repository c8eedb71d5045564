"""Registry of tasks: the package's, found by their files in `tasks`, and custom ones."""

import importlib
import inspect
import pathlib
import pkgutil
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import gymnasium

from softgym_mj.exceptions import (
    InvalidArgumentError,
    UnexpectedArgumentError,
    check_count,
    check_name,
    choices,
)
from softgym_mj.validation import check_type

if TYPE_CHECKING:
    from softgym_mj.tasks import Task


class TaskRecord:
    """Entry of the registry; registering a name again makes a new record.

    Its properties come from the task's class, which is imported on first use.

    Attributes:
        name: snake_case name.
        class_name: "SpreadCloth" for "spread_cloth".
        version: version of the task; scores of different versions do not compare.
        gymnasium_id: "softgym_mj/SpreadCloth-v0" for "spread_cloth".
        is_custom: whether the task is not part of this package.
        suite: suite of the task, one of `SUITES`.
    """

    def __init__(
        self, name: str, task_class: "type[Task] | None" = None, version: int = 0, **overrides
    ):
        """Makes a record.

        Args:
            name: snake_case name.
            task_class: builds the task from keyword arguments; None for the class of this name in
                `softgym_mj.tasks`.
            version: version of the Gymnasium id, 0 or more.
            **overrides: values that replace attributes of the class, where not None.
        """
        self.name, self.is_custom, self.version = name, task_class is not None, version
        self.suite = PLUS if name in _BEYOND else DOMAIN
        self.class_name = "".join(word.title() for word in name.split("_"))
        self.gymnasium_id = f"softgym_mj/{self.class_name}-v{version}"
        self._class = task_class
        self._overrides = {key: value for key, value in overrides.items() if value is not None}

    def __repr__(self) -> str:
        return f"TaskRecord({self.name!r})"

    def resolve(self) -> "type[Task]":
        """Returns the class; imports its module."""
        if self._class is None:
            module = importlib.import_module(f"softgym_mj.tasks.{self.name}")
            self._class = getattr(module, self.class_name)
        return self._class

    def _of_class(self, name: str) -> Any:
        return self._overrides.get(name, getattr(self.resolve(), name))

    @property
    def horizon(self) -> int:
        """Env steps in an episode."""
        return self._of_class("horizon")

    @property
    def action_repeat(self) -> int:
        """Sim steps of 0.01 s per env step."""
        return self._of_class("action_repeat")

    @property
    def summary(self) -> str:
        """Goal of the task, as a sentence in the imperative."""
        return self._of_class("summary")

    @property
    def tags(self) -> tuple[str, ...]:
        """Difficulty and material of the task."""
        task_class = self.resolve()
        return self._overrides.get("tags", (task_class.difficulty, task_class.material))

    @property
    def arguments(self) -> dict[str, Any]:
        """Annotations of the class's keyword arguments by name, including those of `**settings`."""
        annotations: dict[str, Any] = {}
        for parameter in inspect.signature(self.resolve(), eval_str=True).parameters.values():
            if parameter.kind is inspect.Parameter.VAR_KEYWORD:
                annotations |= typing.get_type_hints(_unpacked(parameter))
            else:
                annotations[parameter.name] = parameter.annotation
        return annotations

    def check_arguments(self, arguments: Mapping[str, object], *callers: Callable) -> None:
        """Raises unless all arguments are known to the class and have the right types.

        Args:
            arguments: keyword arguments.
            *callers: functions whose optional arguments are accepted in addition, of any type.

        Raises:
            UnexpectedArgumentError: for an unknown name.
            InvalidArgumentError: for a value of the wrong type.
        """
        signatures = [inspect.signature(caller).parameters.values() for caller in callers]
        known = {p.name: Any for own in signatures for p in own if p.default is not p.empty}
        known = self.arguments | known
        for name, value in arguments.items():
            if name not in known:
                raise UnexpectedArgumentError(
                    f"{self.name} got an unexpected keyword argument {name!r}"
                    + choices(name, known)
                )
            check_type(name, value, known[name])

    def build(self, **task_kwargs) -> "Task":
        """Builds the task.

        Raises:
            UnexpectedArgumentError, InvalidArgumentError: as `check_arguments`.
            SoftGymError: if the class does not call the constructor of `Task`.
        """
        self.check_arguments(task_kwargs)
        if task_kwargs.get("action_repeat") is None and "action_repeat" in self._overrides:
            task_kwargs["action_repeat"] = self._overrides["action_repeat"]
        task = self.resolve()(**task_kwargs)
        task.root_entity  # noqa: B018  It raises an error if there is no scene.
        return task


def _unpacked(parameter: inspect.Parameter) -> type:
    """Returns the TypedDict that annotates a parameter such as `**settings`.

    Raises:
        InvalidArgumentError: if the parameter is not annotated with one.
    """
    if typing.get_origin(parameter.annotation) is not typing.Unpack:
        raise InvalidArgumentError(
            f"task_class does not name the arguments of **{parameter.name}: write "
            f"`**{parameter.name}: Unpack[TaskSettings]`, with `from typing import Unpack` and "
            "`from softgym_mj.tasks import TaskSettings`"
        )
    return typing.get_args(parameter.annotation)[0]


# Versions of the package's tasks whose scores no longer compare (CONTRIBUTING.md); other tasks have
# version 0. They are listed here because ids are registered before tasks are imported.
VERSIONS: dict[str, int] = {}

# Suites, which are domains of dm_control's: SoftGym's ten tasks with custom ones, and others.
DOMAIN, PLUS = SUITES = ("softgym", "softgym_plus")
_BEYOND = ("fold_shirt", "hang_cloth", "route_cable")  # Tasks beyond SoftGym.

# Each file has a class of the same name; the tasks beyond SoftGym come last.
_FILES = pkgutil.iter_modules([str(pathlib.Path(__file__).parent / "tasks")])
_NAMES = sorted((f.name for f in _FILES if not f.ispkg), key=lambda name: (name in _BEYOND, name))
TASKS = {name: TaskRecord(name, version=VERSIONS.get(name, 0)) for name in _NAMES}

_NAME = re.compile("[a-z][a-z0-9]*(_[a-z0-9]+)*")


def register(
    name: str,
    task_class: "type[Task]",
    *,
    horizon: int | None = None,
    tags: Sequence[str] | None = None,
    action_repeat: int | None = None,
    summary: str | None = None,
    version: int = 0,
) -> TaskRecord:
    """Adds a custom task to `TASKS`, Gymnasium's registry and dm_control's suite of this process.

    A custom task of the same name is replaced; names of the package's tasks are reserved.

    Args:
        name: snake_case name: "soak_cloth" becomes "softgym_mj/SoakCloth-v0".
        task_class: a subclass of `softgym_mj.tasks.Task`. Keyword arguments that it passes on as
            `**settings` must be named: `**settings: Unpack[TaskSettings]`, with the `TaskSettings`
            of `softgym_mj.tasks` or another TypedDict.
        horizon: env steps in an episode, 1 or more; None, here and below, for the class's own
            value.
        tags: tags in dm_control's suite; by default difficulty and material.
        action_repeat: sim steps of 0.01 s per env step.
        summary: what to do, in a sentence.
        version: version of the Gymnasium id, 0 or more; raise it when scores no longer compare.

    Returns:
        Its record.

    Raises:
        InvalidArgumentError: for a bad name, class, horizon, action_repeat or version.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        valid = "lower-case words joined by underscores, such as 'soak_cloth'"
        raise InvalidArgumentError("name", name, valid)
    if name in TASKS and not TASKS[name].is_custom:
        shipped = sorted(key for key, record in TASKS.items() if not record.is_custom)
        raise InvalidArgumentError("name", name, f"none of the package's: {', '.join(shipped)}")
    from softgym_mj.tasks import Task

    if not (isinstance(task_class, type) and issubclass(task_class, Task)):
        raise InvalidArgumentError("task_class", task_class, "a subclass of softgym_mj.tasks.Task")
    if task_class.__abstractmethods__:
        missing = ", ".join(sorted(task_class.__abstractmethods__))
        raise InvalidArgumentError(f"task_class={task_class!r} lacks the methods: {missing}")
    for argument, value in (("horizon", horizon), ("action_repeat", action_repeat)):
        if value is not None:
            check_count(argument, value, 1)
    check_count("version", version, 0)
    record = TaskRecord(
        name,
        task_class,
        version,
        horizon=horizon,
        tags=None if tags is None else tuple(tags),
        action_repeat=action_repeat,
        summary=summary,
    )
    _ = record.arguments  # Raises if they have no names.
    if name in TASKS:
        gymnasium.registry.pop(TASKS[name].gymnasium_id, None)
    TASKS[name] = record
    add_gymnasium_id(record)
    list_in_suite()
    return record


def add_gymnasium_id(record: TaskRecord) -> None:
    """Registers the id of a task for `make` and `make_vec`; imports neither task nor environment.

    The id has no `max_episode_steps`: Gymnasium's `TimeLimit` would end episodes at that number,
    regardless of `horizon=` and the actor, and would not reset its count when a state is restored.
    """
    gymnasium.register(
        id=record.gymnasium_id,
        entry_point="softgym_mj.envs.gymnasium_env:SoftGymEnv",
        vector_entry_point="softgym_mj.vector.make:make_vec",
        kwargs={"task": record.name},
    )


def list_in_suite() -> None:
    """Adds the names of `TASKS` to the lists of `dm_control.suite`; imports no task.

    EASY and HARD list dm_control's own tasks only, because tags require importing a task.
    """
    from dm_control import suite

    own = [(record.suite, name) for name, record in TASKS.items()]
    for name in ("ALL_TASKS", "EXTRA", "NO_REWARD_VIZ"):
        others = [pair for pair in getattr(suite, name) if pair[0] not in SUITES]
        setattr(suite, name, tuple(sorted(others + own, key=lambda pair: pair[0])))
    for each in SUITES:
        suite.TASKS_BY_DOMAIN[each] = task_names(each)


def task_names(suite: str) -> tuple[str, ...]:
    """Returns the names of the tasks of a suite, one of `SUITES`.

    Raises:
        InvalidArgumentError: if there is no such suite.
    """
    check_name("suite", suite, SUITES)
    return tuple(name for name, record in TASKS.items() if record.suite == suite)


def by_softgym_name() -> dict[str, TaskRecord]:
    """Returns the records of SoftGym's tasks by their names there."""
    shipped = [each for each in TASKS.values() if each.suite == DOMAIN and not each.is_custom]
    return {str(record.resolve().softgym_name): record for record in shipped}


def find(task: str | TaskRecord) -> TaskRecord:
    """Returns the record of a task.

    Args:
        task: task name, one of `TASKS`; "module:name" for a custom task, whose module is imported
            first so that it calls `register`; or a record, which is returned.

    Raises:
        InvalidArgumentError: if there is no such task; if the module cannot be imported or
            registers no task.
    """
    if isinstance(task, TaskRecord):
        return task
    if not isinstance(task, str) or ":" not in task:
        if isinstance(task, str) and task not in TASKS and (new := by_softgym_name().get(task)):
            raise InvalidArgumentError(f"task={task!r} is SoftGym's name of the task {new.name!r}")
        check_name("task", task, (*TASKS, "MODULE:NAME"))
        return TASKS[task]
    module, name = task.split(":", 1)
    try:
        imported = importlib.import_module(module)
    except Exception as error:  # The module may raise anything.
        raise InvalidArgumentError(
            f"task={task!r}: {module!r} cannot be imported: {type(error).__name__}: "
            f"{str(error).rstrip('.')}; `python -c 'import {module}'` has to work"
        ) from error
    if name not in TASKS:
        if own := [f"{module}:{key}" for key, record in TASKS.items() if record.is_custom]:
            raise InvalidArgumentError("task", task, own)
        raise InvalidArgumentError(
            f"task={task!r}: {imported!r} registers no task when it is imported; call "
            "softgym_mj.register in it, not below `if __name__ == '__main__'`"
        )
    return TASKS[name]
