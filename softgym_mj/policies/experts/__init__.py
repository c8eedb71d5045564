"""Scripted experts: hand-written policies that see the whole state.

They read positions straight from the task: not baselines to learn against, but evidence that the
actors can solve the tasks. Each writes an episode as a generator of actions; all are
deterministic.
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


def sources_sha256(task: TaskRecord) -> str:
    """SHA-256 of the sources that say what the expert of a task does, as hexadecimal digits.

    They are those of all experts, which share code, and the file of the task's class, if it is in
    one: that of a notebook is not.
    """
    files = sorted(pathlib.Path(__file__).parent.glob("*.py"))
    with contextlib.suppress(TypeError, OSError):
        files.append(pathlib.Path(inspect.getfile(task.resolve())))
    digest = hashlib.sha256()
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
