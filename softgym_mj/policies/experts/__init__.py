"""Scripted experts: hand-written policies that see the whole state.

They read positions straight from the task: not baselines to learn against, but evidence that the
actors can solve the tasks. Each writes an episode as a generator of actions; all are
deterministic.
"""

import importlib
import pathlib
import pkgutil
from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts.expert import OwnExpert, WithExpert
from softgym_mj.registry import TASKS

# Names of tasks with an expert: a file each, with a class of the name of the task's.
EXPERTS = tuple(
    module.name
    for module in pkgutil.iter_modules([str(pathlib.Path(__file__).parent)])
    if module.name in TASKS
)


def make_policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """The expert for the task of an environment.

    Args:
        env: environment with two pickers or arms, or with one actor for the cup; or of a custom
            task that is `WithExpert`.

    Raises:
        InvalidArgumentError: if the task has no expert.
    """
    if isinstance(env.task, WithExpert):
        return OwnExpert(env)
    if env.name not in EXPERTS:
        raise InvalidArgumentError(
            f"policy='scripted': there is no scripted expert for {env.name}; valid choices: "
            "'random', 'zero', a FILE.pt2 or MODULE:FUNCTION. The class of the task may bring one: "
            "a generator `expert(self)` of the actions of an episode"
        )
    module = importlib.import_module(f"softgym_mj.policies.experts.{env.name}")
    return getattr(module, TASKS[env.name].class_name)(env)
