"""Policies of yours: files that `torch.export.save` wrote, functions of modules.

Both are code. A module is imported by the name that the user gives. A file may look like data but
can hold pickles, and in the JSON of its graph expressions, guards and names, all of which PyTorch
executes when it loads it: there is no way to load one that cannot run code, so the user says so.
"""

import hashlib
import importlib
import inspect
import io
import json
import os
import pathlib
import traceback
import zipfile
from collections.abc import Callable
from typing import Any

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, SoftGymError, import_extra
from softgym_mj.jobs.files import read_whole

Policy = Callable[[dm_env.TimeStep], np.ndarray]

SUFFIX = ".pt2"
NOTE = "softgym_mj.json"  # Extra file in a policy's file: the arguments `observes` returns.
SEED = "{seed}"  # In the name of a file: policies that were trained with several seeds.


def is_saved(name: str) -> bool:
    """Whether a policy is named by a file (`policy.pt2`) or a function (`package.module:name`)."""
    return ":" in name or name.endswith(SUFFIX)


def takes_seed(name: str) -> bool:
    """Whether seeds tell policies of this name apart: by its file's name or an argument `seed`.

    Raises:
        InvalidArgumentError: for a function that cannot be imported.
    """
    if name.endswith(SUFFIX):
        return SEED in name
    function = _function(name)
    try:
        return "seed" in inspect.signature(function).parameters
    except (TypeError, ValueError):  # Not a function, or a built-in one.
        return False


def sha256(name: str, seed: int) -> dict[str, str]:
    """SHA-256 of a policy's file, or of the source file of its function, by name.

    Empty for a function that no file has, such as one of a notebook.

    Raises:
        StoreError: for a file that cannot be read.
        InvalidArgumentError: for a function that cannot be imported.
    """
    if name.endswith(SUFFIX):
        name = name.replace(SEED, str(seed))
        return {name: hashlib.sha256(read_whole(name)).hexdigest()}
    _function(name)
    source = getattr(importlib.import_module(name.split(":", 1)[0]), "__file__", None)
    if source is None:
        return {}
    return {name: hashlib.sha256(read_whole(source)).hexdigest()}


def observes(name: str, seed: int) -> dict[str, Any]:
    """Arguments of a task by which a policy's file says what the policy observes.

    They are in the file of a policy that `softgym-mj train` wrote, or in the card beside it, which
    has the same name with the suffix .json. No code of the file is run.

    Returns:
        `observation`, and `image_size` with images; empty where nothing is said.

    Raises:
        InvalidArgumentError: for a note or a card that is not JSON of this form.
    """
    file = pathlib.Path(name.replace(SEED, str(seed)))
    card = file.with_suffix(".json")
    if not name.endswith(SUFFIX) or not os.path.isfile(file):  # False for impossible names.
        return {}
    try:
        found: Any = None
        if zipfile.is_zipfile(file):
            with zipfile.ZipFile(file) as archive:
                notes = [each for each in archive.namelist() if each.endswith(f"/extra/{NOTE}")]
                found = json.loads(archive.read(notes[0])) if notes else None
        if found is None and os.path.isfile(card):
            found = json.loads(read_whole(card)).get("training")
        if found is None:
            return {}
        observation = str(found["observation"])
        sized = {"image_size": [*found["image_size"]]} if observation == "rgb" else {}
    except (ValueError, LookupError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        message = f"policy={name!r}: what it observes cannot be read from it or {card}: {error!r}"
        raise InvalidArgumentError(message) from error
    return {"observation": observation, **sized}


def make_saved(name: str, env: Environment, seed: int, trust: bool) -> Policy:
    """The policy of a file or a function; see `policies.make_policy`."""
    if name.endswith(SUFFIX):
        wanted = observes(name, seed).get("observation")
        return _exported(name.replace(SEED, str(seed)), env, trust, wanted)
    return _imported(name, env, seed)


def _exported(file: str, env: Environment, trust: bool, wanted: str | None) -> Policy:
    content = read_whole(file)
    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise InvalidArgumentError(
            f"policy={file!r} is not what torch.export.save(torch.export.export(module, "
            "(observation,)), file) writes"
        )
    if trust is not True:
        raise InvalidArgumentError(
            f"policy={file!r} is not loaded: such a file can run any code on this machine, with "
            "all your rights, as soon as it is loaded. If you trust whoever made it, say so: "
            "trust=True, or --trust on the command line"
        )
    torch = import_extra("torch", "PyTorch", "rl")
    try:
        module = torch.export.load(io.BytesIO(content)).module()
    except Exception as error:  # torch raises whatever its reader happens to meet.
        raise InvalidArgumentError(f"policy={file!r} cannot be loaded: {error}") from error
    size = env.task.actor.action_size

    def act(timestep: dm_env.TimeStep) -> np.ndarray:
        batch = torch.from_numpy(_single(file, timestep, wanted)[None])
        with torch.no_grad():
            try:
                action = module(batch)
            except (RuntimeError, AssertionError, ValueError, TypeError) as error:
                shape = tuple(batch.shape)
                raise InvalidArgumentError(
                    f"policy={file!r} does not take an observation of shape {shape}, "
                    f"{batch.dtype}: {error}; export it with an example like this: "
                    f"torch.export.export(module, (torch.zeros({shape}, dtype={batch.dtype}),))"
                ) from error
        action = np.asarray(action, float).reshape(-1)
        if action.shape != (size,):
            raise InvalidArgumentError(
                f"policy={file!r} gives {action.size} numbers; an action has {size}"
            )
        return np.clip(action, -1.0, 1.0)

    return act


def _single(file: str, timestep: dm_env.TimeStep, wanted: str | None) -> np.ndarray:
    """The only observation, as Gymnasium's environment gives it: images uint8, others float32."""
    if wanted is not None and [*timestep.observation] != [wanted]:
        raise InvalidArgumentError(
            f"policy={file!r} was trained with observation={wanted!r}; the environment observes "
            f"{', '.join(timestep.observation)}"
        )
    if len(timestep.observation) != 1:
        raise InvalidArgumentError(
            f"policy={file!r} takes one observation; the settings ask for "
            f"{', '.join(timestep.observation)}"
        )
    (observation,) = timestep.observation.values()
    return observation if observation.dtype == np.uint8 else observation.astype(np.float32)


def _imported(name: str, env: Environment, seed: int) -> Policy:
    make = _function(name)
    settings = {"seed": seed} if takes_seed(name) else {}
    try:
        policy = make(env, **settings)
    except SoftGymError:
        raise
    except Exception as error:  # Whatever the function raises.
        where = traceback.extract_tb(error.__traceback__)[-1]
        raise InvalidArgumentError(
            f"policy={name!r} made no policy of an environment: {type(error).__name__}: {error} "
            f"({where.filename}:{where.lineno})"
        ) from error
    if not callable(policy):
        raise InvalidArgumentError(
            f"policy={name!r} gives {policy!r}, not a function of time steps"
        )
    return policy


def _function(name: str) -> Any:
    module, function = name.split(":", 1)
    try:
        return getattr(importlib.import_module(module), function)
    except Exception as error:  # Whatever the code of the module raises.
        raise InvalidArgumentError(
            f"policy={name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
