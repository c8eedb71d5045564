"""The `softgym` domain of `dm_control.suite`."""

import importlib.abc
import importlib.machinery
import sys
import types
from collections.abc import Mapping

from softgym_mj import registry
from softgym_mj.envs.load import load
from softgym_mj.exceptions import InvalidArgumentError

DOMAIN = "softgym"
_SUITE_MODULE = "dm_control.suite"


def _constructor(name: str):
    def build(random=None, environment_kwargs=None, **kwargs):
        # Tasks of the suite call the seed `random`.
        seed = {} if random is None else {"random_state": random}
        groups = {"task_kwargs": kwargs, "random": seed, "environment_kwargs": environment_kwargs}
        given: dict = {}
        for argument, group in groups.items():
            if not isinstance(group or {}, Mapping) or given.keys() & (group or {}):
                valid = "a dict, of other names than those in task_kwargs"
                raise InvalidArgumentError(argument, group, valid)
            given |= group or {}
        return load(name, **given)

    build.__name__ = name  # The container takes the task's name from the function's.
    return build


def _tasks():
    from dm_control.utils import containers

    tasks = containers.TaggedTasks()
    for record in registry.TASKS.values():
        tasks.add(*record.tags, "no_reward_visualization")(_constructor(record.name))
    return tasks


def __getattr__(name: str):
    if name == "SUITE":  # What dm_control.suite looks for in a domain: built when asked for.
        return _tasks()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class _Suite(types.ModuleType):
    """`dm_control.suite` whose lists of tasks are those of the moment, not of its import."""

    ALL_TASKS = property(lambda suite: suite._get_tasks(None))
    EASY = property(lambda suite: suite._get_tasks("easy"))
    HARD = property(lambda suite: suite._get_tasks("hard"))
    NO_REWARD_VIZ = property(lambda suite: suite._get_tasks("no_reward_visualization"))
    EXTRA = property(lambda suite: tuple(sorted({*suite.ALL_TASKS} - {*suite.BENCHMARKING})))
    TASKS_BY_DOMAIN = property(lambda suite: suite._get_tasks_by_domain(suite.ALL_TASKS))


def _add_domain(suite) -> None:
    suite._DOMAINS[DOMAIN] = sys.modules[__name__]
    suite.__class__ = _Suite


class _SuiteFinder(importlib.abc.MetaPathFinder):
    """Adds the domain when `dm_control.suite` is imported, so that we need not import it."""

    def find_spec(self, fullname, path, target=None):
        if fullname != _SUITE_MODULE:
            return None
        sys.meta_path.remove(self)
        spec = importlib.machinery.PathFinder.find_spec(fullname, path)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def exec_module(module):
                execute(module)
                _add_domain(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def register() -> None:
    """Makes `dm_control.suite.load("softgym", task)` work, now or when it is imported."""
    if _SUITE_MODULE in sys.modules:
        _add_domain(sys.modules[_SUITE_MODULE])
    elif not any(isinstance(finder, _SuiteFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _SuiteFinder())
