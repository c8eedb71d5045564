"""The domains `softgym` and `softgym_plus` of `dm_control.suite`."""

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


class _Domain:
    """Domain of a suite, as a module of dm_control's that has tasks."""

    def __init__(self, suite: str):
        self._suite = suite

    @property
    def SUITE(self):
        """Tasks by name and tag, built at each use: tags require importing the tasks."""
        from dm_control.utils import containers

        class Tasks(containers.TaggedTasks):
            """Tasks, and by "module:name" those that a module registers on import."""

            def __getitem__(self, name):
                return _constructor(name) if ":" in name else super().__getitem__(name)

        tasks = Tasks()
        for name in registry.task_names(self._suite):
            tags = registry.TASKS[name].tags
            tasks.add(*tags, "no_reward_visualization")(_constructor(name))
        return tasks


def register() -> None:
    """Registers the domains for `dm_control.suite.load("softgym", task)`, and lists their tasks."""
    from dm_control import suite

    suite._DOMAINS.update({name: _Domain(name) for name in registry.SUITES})
    registry.list_in_suite()
