"""Policies by name or file: what `evaluate` can score."""

import importlib
import pathlib
import zipfile
from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.environment import Environment
from softgym_mj.exceptions import PolicyFileError, check_name
from softgym_mj.extras import import_extra

Policy = Callable[[dm_env.TimeStep], np.ndarray]

SIMPLE = ("scripted", "random", "zero")
_SEED_KEY = 0x52414E44  # Keeps the random policy's numbers apart from others.


def is_saved(name: str) -> bool:
    """Whether a policy is named by a file (`policy.pt2`) or a function (`package.module:name`)."""
    return ":" in name or name.endswith(".pt2")


def make_policy(name: str, env: Environment, seed: int = 0) -> Policy:
    """A policy that does not plan.

    Args:
        name: one of `SIMPLE`; a file that `torch.export.save` wrote, of a module that maps the
            observation (1, n) float32 to an action (1, m); or "module:function", a function that
            gives for an environment a policy: a function of its time steps.
        env: what it acts in.
        seed: of the random policy.

    Raises:
        UnknownNameError: if there is no such policy.
        PolicyFileError: for a file or function that is none.
        ExpertError: if the task has no scripted expert.
    """
    if name.endswith(".pt2"):
        return _exported(pathlib.Path(name), env)
    if ":" in name:
        return _imported(name, env)
    check_name("policy", name, SIMPLE)
    if name == "scripted":
        from softgym_mj.baselines import scripted

        return scripted.make_policy(env)
    size = env.task.actor.action_size
    if name == "zero":
        return lambda timestep: np.zeros(size)
    return _Random(env, seed)


class _Random:
    """Uniform actions; those of an episode depend on seed and variation alone."""

    def __init__(self, env: Environment, seed: int):
        self._env, self._seed = env, seed

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        if timestep.first():
            key = [_SEED_KEY, self._seed, self._env.task.variation]
            self._random = np.random.default_rng(key)
        return self._random.uniform(-1.0, 1.0, self._env.task.actor.action_size)


def _exported(file: pathlib.Path, env: Environment) -> Policy:
    if not file.is_file():
        raise PolicyFileError(f"policy={str(file)!r}: there is no such file")
    if not zipfile.is_zipfile(file):
        raise PolicyFileError(
            f"policy={str(file)!r} is not what torch.export.save(torch.export.export(module, "
            "(observation,)), file) writes"
        )
    torch = import_extra("torch", "PyTorch", "rl")
    try:
        module = torch.export.load(file).module()
    except Exception as error:  # torch raises whatever its reader happens to meet.
        raise PolicyFileError(f"policy={str(file)!r} cannot be loaded: {error}") from error
    size = env.task.actor.action_size

    def act(timestep: dm_env.TimeStep) -> np.ndarray:
        (observation,) = timestep.observation.values()
        with torch.no_grad():
            try:
                action = module(torch.from_numpy(observation.astype(np.float32))[None])
            except (RuntimeError, AssertionError, ValueError, TypeError) as error:
                raise PolicyFileError(
                    f"policy={str(file)!r} does not take an observation of shape "
                    f"(1, {observation.size}): {error}"
                ) from error
        action = np.asarray(action, float).reshape(-1)
        if action.shape != (size,):
            raise PolicyFileError(
                f"policy={str(file)!r} gives {action.size} numbers; an action has {size}"
            )
        return np.clip(action, -1.0, 1.0)

    return act


def _imported(name: str, env: Environment) -> Policy:
    module, function = name.split(":", 1)
    try:
        make = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise PolicyFileError(f"policy={name!r} cannot be imported: {error}") from error
    policy = make(env)
    if not callable(policy):
        raise PolicyFileError(f"policy={name!r} gives {policy!r}, not a function of time steps")
    return policy
