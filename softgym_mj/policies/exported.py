"""Policies as files of `torch.export.save`, with the observations that they need.

The extra file `NOTE` in such a file has the task, its arguments of the policy's observation, its
actor and the number of stacked frames.
"""

import io
import json
import os
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import dm_env
import gymnasium
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, StoreError, import_extra
from softgym_mj.robots.gripper import HELD
from softgym_mj.storage.files import read_whole
from softgym_mj.tasks.shared.observations import STATES, names_of

Policy = Callable[[dm_env.TimeStep], np.ndarray]

SUFFIX = ".pt2"
NOTE = "softgym_mj.json"
# Where to download published policies.
FILES = "the documentation has published policies as files (Results, Policies)"


def export_policy(
    module: Any,
    spaces: Mapping[str, gymnasium.spaces.Box],
    observed: Mapping[str, Any],
    frames: int = 1,
    task: str | None = None,
) -> bytes:
    """Returns the content of a policy's file.

    Args:
        module: Maps an observation (1, ...) to an action (1, n). With `frames` above 1, or several
            observations, it maps a dict of them by name; its images are (1, frames, ...), the
            oldest first.
        spaces: Spaces of the observations by name.
        observed: Arguments of the task: `observation`, `image_size` with images, and `actor` unless
            it is the default.
        frames: Number of stacked frames.
        task: Name of the task, for messages.
    """
    torch = import_extra("torch", "PyTorch", "learning")
    is_dict = len(spaces) > 1 or frames > 1
    examples = {
        name: torch.zeros(
            1, *[frames] * (is_dict and len(space.shape) > 1), *space.shape,
            dtype=getattr(torch, str(space.dtype)),
        )
        for name, space in spaces.items()
    }  # fmt: skip
    example = examples if is_dict else next(iter(examples.values()))
    exported = torch.export.export(module.eval(), (example,))
    for node in exported.graph.nodes:  # Stack traces contain paths of this machine.
        node.meta.pop("stack_trace", None)
    file, note = io.BytesIO(), {**observed, "frames": frames, "task": task}
    torch.export.save(exported, file, extra_files={NOTE: json.dumps(note)})
    return file.getvalue()


def observes(file: str) -> dict[str, Any]:
    """Returns the task arguments that give a saved policy its observation; empty if unknown.

    They are `observation`, `image_size` with images, and `actor` unless it is the default, from the
    policy's file, as `softgym-mj train` writes it. No code is run.

    Raises:
        InvalidArgumentError: for a note that is not JSON of this form.
    """
    return {name: value for name, value in _note(file).items() if name not in ("frames", "task")}


def has_images(observation: str | Sequence[str]) -> bool:
    """Returns whether one of these observations is an image."""
    return not {*names_of(observation)} <= {*STATES, HELD}


def _note(name: str) -> dict[str, Any]:
    """Returns the arguments of `observes`, `frames` and `task`; empty for files without a note."""
    if not name.endswith(SUFFIX) or not os.path.isfile(name) or not zipfile.is_zipfile(name):
        return {}  # `isfile` is false for impossible names.
    try:
        with zipfile.ZipFile(name) as archive:
            notes = [each for each in archive.namelist() if each.endswith(f"/extra/{NOTE}")]
            if not notes:
                return {}
            result = json.loads(archive.read(notes[0]))
        observation, frames = result["observation"], int(result.get("frames", 1))
        seen = observation if isinstance(observation, str) else [*map(str, observation)]
        own = {"actor": str(result["actor"])} if "actor" in result else {}
        sized = {"image_size": [*result["image_size"]]} if has_images(seen) else {}
    except (ValueError, LookupError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        message = f"policy={name!r}: its observation cannot be read: {error!r}"
        raise InvalidArgumentError(message) from error
    return {"observation": seen, **sized, **own, "frames": frames, "task": result.get("task")}


def read_policy(file: str) -> bytes:
    """Returns the content of a policy's file; `StoreError` if it cannot be read."""
    try:
        return read_whole(file)
    except StoreError as error:
        raise StoreError(f"{error}; {FILES}") from error


def load_exported(file: str, env: Environment, trust: bool) -> Policy:
    """Returns the policy of a file, with the arguments of `make_policy`."""
    content = read_policy(file)
    if not zipfile.is_zipfile(io.BytesIO(content)):
        raise InvalidArgumentError(
            f"policy={file!r} is not what torch.export.save(torch.export.export(module, "
            "(observation,)), file) writes"
        )
    if trust is not True:
        raise InvalidArgumentError(
            f"policy={file!r} is not loaded: loading can run any code on this machine with your "
            "rights; pass trust=True (command line: --trust) if you trust its author"
        )
    torch = import_extra("torch", "PyTorch", "learning")
    try:
        program = torch.export.load(io.BytesIO(content))
        module = program.module()
    except Exception as error:  # torch's reader may raise any error.
        raise InvalidArgumentError(f"policy={file!r} cannot be loaded: {error}") from error
    size, inputs = env.task.actor.action_size, _Inputs(file)
    nodes = {node.name: node.meta.get("val") for node in program.graph.nodes}
    expected = _shapes(map(nodes.get, program.graph_signature.user_inputs))

    def act(timestep: dm_env.TimeStep) -> np.ndarray:
        batch = {name: torch.from_numpy(array) for name, array in inputs(timestep).items()}
        with torch.no_grad():
            try:
                action = module(batch if inputs.is_dict else next(iter(batch.values())))
            except (RuntimeError, AssertionError, ValueError, TypeError) as error:
                shown = ", ".join(
                    f"{name} of shape {tuple(tensor.shape)}, {tensor.dtype}"
                    for name, tensor in batch.items()
                )
                is_same = _shapes(batch.values()) == expected
                reason = error if is_same else _exported_for(file, expected)
                raise InvalidArgumentError(
                    f"policy={file!r} does not take {shown}: {reason}; "
                    "choose its task, actor and observation, or export it with an example of this "
                    "shape and type: torch.export.export(module, (torch.zeros(...),))"
                ) from error
        action = np.asarray(action, float).reshape(-1)
        if action.shape != (size,):
            raise InvalidArgumentError(
                f"policy={file!r} returns {action.size} numbers; an action has {size}"
            )
        return np.clip(action, -1.0, 1.0)

    return act


def _shapes(tensors: Iterable[Any]) -> list[str]:
    """Returns shapes and types of tensors, sorted; an input that is no tensor has none."""
    return sorted(
        f"{tuple(each.shape)}, {each.dtype}" for each in tensors if hasattr(each, "shape")
    )


def _exported_for(file: str, shapes: Sequence[str]) -> str:
    """Returns the inputs and, from the note, the task of a policy's training."""
    note = _note(file)
    observed = f" of observation={note['observation']!r}" if note else ""
    task = f" in {note['task']}" if note.get("task") else ""
    return f"it was exported for shape {' and '.join(shapes)}{observed}{task}"


class _Inputs:
    """Converts time steps of an episode, in order, to the inputs of a saved policy.

    Attributes:
        is_dict: Whether the policy takes a dict of observations instead of one array.
    """

    def __init__(self, file: str):
        note = _note(file)
        self._file, self._named, self._frames = file, note.get("observation"), note.get("frames", 1)
        self.is_dict = self._frames > 1 or isinstance(self._named, list)
        self._stacks: dict[str, list[np.ndarray]] = {}

    def __call__(self, timestep: dm_env.TimeStep) -> dict[str, np.ndarray]:
        """Returns arrays (1, ...) by name, as Gymnasium has them: images uint8, others float32."""
        seen, named = timestep.observation, self._named
        own = {*(seen if named is None else names_of(named))}
        if not own <= seen.keys():
            raise InvalidArgumentError(
                f"policy={self._file!r} was trained with observation={named!r}; the environment "
                f"observes {', '.join(seen)}"
            )
        if named is None and len(seen) != 1:
            raise InvalidArgumentError(
                f"policy={self._file!r} takes one observation; the settings ask for "
                f"{', '.join(seen)}"
            )
        return {name: self._single(name, seen[name], timestep) for name in seen if name in own}

    def _single(self, name: str, array: np.ndarray, timestep: dm_env.TimeStep) -> np.ndarray:
        if array.dtype != np.uint8:
            array = array.astype(np.float32)
        if self.is_dict and array.ndim > 1:
            array = self._stacked(name, array, timestep.first())
        return array[None]

    def _stacked(self, name: str, array: np.ndarray, is_first: bool) -> np.ndarray:
        """Returns the newest images (frames, ...); the first one of an episode is repeated."""
        before = [array] * self._frames if is_first else self._stacks[name]
        self._stacks[name] = [*before[1:], array]
        return np.stack(self._stacks[name])
