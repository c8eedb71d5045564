"""Saved policies: files of `torch.export.save` and functions of modules.

Both run code. A file can contain pickles and, in its JSON graph, expressions, guards and names, all
of which PyTorch executes on loading. No loading is safe, so it requires `trust=True`.
"""

import hashlib
import importlib
import inspect
import traceback
from typing import Any

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, SoftGymError
from softgym_mj.policies.exported import SUFFIX, Policy, load_exported, read_policy
from softgym_mj.storage.files import read_whole

SEED = "{seed}"  # Placeholder in file names of policies that were trained with several seeds.


def is_saved(name: str) -> bool:
    """Returns whether a name is a file (`policy.pt2`) or a function (`package.module:name`)."""
    return ":" in name or name.endswith(SUFFIX)


def takes_seed(name: str) -> bool:
    """Returns whether a saved policy depends on its seed: by its file name or an argument `seed`.

    Raises:
        InvalidArgumentError: for a function that cannot be imported.
    """
    if name.endswith(SUFFIX):
        return SEED in name
    function = imported(name)
    try:
        return "seed" in inspect.signature(function).parameters
    except (TypeError, ValueError):  # Not a function, or a built-in one.
        return False


def sha256(name: str, seed: int) -> dict[str, str]:
    """Returns SHA-256 of a policy's file, or of the source file of its function, by name.

    The result is empty for a function without a file, such as one of a notebook.

    Raises:
        StoreError: for a file that cannot be read.
        InvalidArgumentError: for a function that cannot be imported.
    """
    if name.endswith(SUFFIX):
        name = name.replace(SEED, str(seed))
        return {name: hashlib.sha256(read_policy(name)).hexdigest()}
    imported(name)
    source = getattr(importlib.import_module(name.split(":", 1)[0]), "__file__", None)
    if source is None:
        return {}
    return {name: hashlib.sha256(read_whole(source)).hexdigest()}


def make_saved(name: str, env: Environment, seed: int, trust: bool) -> Policy:
    """Returns the policy of a file or a function, with the arguments of `make_policy`."""
    if name.endswith(SUFFIX):
        return load_exported(name.replace(SEED, str(seed)), env, trust)
    return _imported(name, env, seed)


def _imported(name: str, env: Environment, seed: int) -> Policy:
    make = imported(name)
    settings = {"seed": seed} if takes_seed(name) else {}
    try:
        policy = make(env, **settings)
    except SoftGymError:
        raise
    except Exception as error:  # Whatever the function raises.
        where = traceback.extract_tb(error.__traceback__)[-1]
        raise InvalidArgumentError(
            f"policy={name!r} failed for an environment: {type(error).__name__}: {error} "
            f"({where.filename}:{where.lineno})"
        ) from error
    if not callable(policy):
        raise InvalidArgumentError(
            f"policy={name!r} returns {policy!r}, not a function of time steps"
        )
    return policy


def imported(name: str, argument: str = "policy") -> Any:
    """Returns what "module:name" names, the value of an argument.

    Raises:
        InvalidArgumentError: if it cannot be imported.
    """
    module, function = name.split(":", 1)
    try:
        return getattr(importlib.import_module(module), function)
    except Exception as error:  # Whatever the code of the module raises.
        raise InvalidArgumentError(
            f"{argument}={name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
