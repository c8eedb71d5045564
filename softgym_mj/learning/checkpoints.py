"""Checkpoints: PyTorch files with a checksum, the last two of a folder, and the folder's lock.

The lock ensures that a single process trains in a folder.
"""

import contextlib
import hashlib
import io
import os
import pathlib
import pickle
import platform
from collections.abc import Iterator, Mapping
from typing import Any

import filelock
import torch
from torch import Tensor

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import (
    make_folder,
    naming,
    read_json,
    read_whole,
    write_json,
    write_whole,
)

FILE, PREVIOUS = "checkpoint.pt", "checkpoint.previous.pt"
LOCK, HOLDER = "training.lock", "training.json"
_DIGEST = 64  # Characters of a hexadecimal SHA-256.
_PARTS = {"owner", "learner", "rows", "done", "part", "seconds"}


def write_checkpoint(folder: pathlib.Path, state: Mapping[str, Any]) -> None:
    """Writes `folder`/checkpoint.pt atomically and keeps the previous one.

    Raises:
        StoreError: if it cannot be written; the previous one remains.
    """
    buffer = io.BytesIO()
    torch.save(dict(state), buffer)
    # The checksum is the comment of the zip file, so that `torch.load` can read the file, too.
    body = buffer.getvalue()[:-2] + _DIGEST.to_bytes(2, "little")
    if (folder / FILE).exists():
        with naming(folder / PREVIOUS, "written"):
            os.replace(folder / FILE, folder / PREVIOUS)
    write_whole(folder / FILE, body + hashlib.sha256(body).hexdigest().encode())


def read_checkpoint(folder: pathlib.Path) -> dict[str, Any] | None:
    """Returns the newest checkpoint of a folder, with its arrays on the CPU; None without one.

    Raises:
        StoreError: for a damaged file, or one that is no checkpoint.
    """
    name = next((name for name in (FILE, PREVIOUS) if os.path.lexists(folder / name)), None)
    if name is None:
        return None
    content = read_whole(folder / name)
    body, digest = content[:-_DIGEST], content[-_DIGEST:]
    if hashlib.sha256(body).hexdigest().encode() != digest:
        raise refused(folder, "its checksum is wrong")
    try:
        state = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, LookupError, ValueError, TypeError) as error:
        raise refused(folder, str(error)) from error
    if not isinstance(state, dict) or state.keys() != _PARTS:
        raise refused(folder, f"it does not have the parts {sorted(_PARTS)}")
    return state


def refused(folder: pathlib.Path, reason: str) -> StoreError:
    """Returns the error for a checkpoint that does not fit."""
    if not os.path.lexists(folder / FILE):
        file, advice = folder / PREVIOUS, "to begin anew"
    elif os.path.lexists(folder / PREVIOUS):
        file, advice = folder / FILE, f"to continue from {folder / PREVIOUS}"
    else:
        file, advice = folder / FILE, "to begin anew"
    message = f"{file} is damaged, or no checkpoint of this training: {reason}"
    return StoreError(f"{message}; delete it {advice}")


def with_env_steps(owner: Mapping[str, Any], env_steps: int) -> Mapping[str, Any]:
    """Returns the settings of a checkpoint with other env steps of the whole training."""
    return {**owner, "training": {**owner["training"], "env_steps": env_steps}}


def differences(saved: Mapping[str, Any], own: Mapping[str, Any]) -> str:
    """Returns the names of settings that differ from a checkpoint's; empty if none does."""
    result = []
    for name, value in own.items():
        other = saved.get(name)
        if isinstance(value, Mapping) and isinstance(other, Mapping):
            names = {*value, *other}
            result += sorted(each for each in names if value.get(each) != other.get(each))
        elif value != other:
            result.append(name)
    return ", ".join(result)


def moved(value: Any, device: str) -> Any:
    """Copies tensors, or tuples, lists and dicts of tensors, to a device."""
    if isinstance(value, Tensor):
        return value.to(device)
    if isinstance(value, dict):
        return {name: moved(each, device) for name, each in value.items()}
    if isinstance(value, tuple | list):
        return tuple(moved(each, device) for each in value)
    return value


@contextlib.contextmanager
def alone(folder: pathlib.Path) -> Iterator[None]:
    """Locks a folder; the lock ends with its process.

    Raises:
        StoreError: if another training holds the lock, with its process; if there is no folder.
    """
    make_folder(folder)
    lock = filelock.FileLock(folder / LOCK, thread_local=False)
    with naming(folder / LOCK, "written"):
        try:
            lock.acquire(blocking=False)
        except filelock.Timeout:
            message = f"{folder} is in use by another training{_holder(folder)}"
            raise StoreError(message) from None
    try:
        write_json(folder / HOLDER, {"pid": os.getpid(), "host": platform.node()})
        yield
    finally:
        lock.release()


def _holder(folder: pathlib.Path) -> str:
    """Returns a description of the process that holds the lock; empty if it has just started."""
    if not (folder / HOLDER).exists():
        return ""
    result = read_json(folder / HOLDER)
    return f", process {result.get('pid')} on {result.get('host')}"
