"""The `softgym` domain of `dm_control.suite`."""

import sys
from collections.abc import Mapping

from softgym_mj import registry
from softgym_mj.envs.load import load
from softgym_mj.exceptions import InvalidArgumentError


def _constructor(name: str):
    def build(random=None, environment_kwargs=None, **kwargs):
        # The suite's name for the seed is `random`.
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
    if name == "SUITE":  # dm_control.suite expects this attribute; it is built on first use.
        return _tasks()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def register() -> None:
    """Registers the domain for `dm_control.suite.load("softgym", task)`, and lists its tasks."""
    from dm_control import suite

    suite._DOMAINS[registry.DOMAIN] = sys.modules[__name__]
    registry.list_in_suite()
