"""Scripted experts: deterministic hand-written policies with access to the whole state.

They show that the actors can solve the tasks and provide demonstrations; they are no baselines for
learning. Each defines an episode as a generator of actions.
"""

import contextlib
import hashlib
import importlib
import inspect
import pathlib
import pkgutil
from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts.expert import OwnExpert, WithExpert
from softgym_mj.registry import TASKS, TaskRecord
from softgym_mj.validation import check_type

# Names of tasks with an expert: a file each, with a class of the name of the task's.
EXPERTS = tuple(
    module.name
    for module in pkgutil.iter_modules([str(pathlib.Path(__file__).parent)])
    if module.name in TASKS
)


def make_policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """Returns the expert of an environment's task.

    Raises:
        InvalidArgumentError: if the task has no expert, or for another environment than one of
            `load`.
    """
    check_type("env", env, Environment)
    if isinstance(env.task, WithExpert):
        return OwnExpert(env)
    if env.name not in EXPERTS:
        raise InvalidArgumentError(
            f"policy='scripted': there is no scripted expert for {env.name}; valid choices: "
            "'random', 'zero', a FILE.pt2 or MODULE:FUNCTION. The class of a task can define one: "
            "a generator `expert(self)` that yields the actions of an episode"
        )
    module = importlib.import_module(f"softgym_mj.policies.experts.{env.name}")
    return getattr(module, TASKS[env.name].class_name)(env)


def sources_sha256(task: TaskRecord) -> str:
    """Returns the SHA-256 (hexadecimal) of the sources of a task's expert.

    These are all experts, which share code, and the file of the task's class if there is one.
    """
    files = sorted(pathlib.Path(__file__).parent.glob("*.py"))
    with contextlib.suppress(TypeError, OSError):
        files.append(pathlib.Path(inspect.getfile(task.resolve())))
    digest = hashlib.sha256()
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
