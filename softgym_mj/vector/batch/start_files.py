"""Initial states on disk, so that the next training of a task need not make them again."""

import contextlib
import functools
import hashlib
import importlib.metadata
import io
import json
import pathlib
import pickle
import shutil
import time
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from softgym_mj.exceptions import StoreError
from softgym_mj.native.caches import cache_folder
from softgym_mj.storage.store import Codec, Key, Store
from softgym_mj.vector.batch.padded_rows import leaves

_PACKAGE = pathlib.Path(__file__).parents[2]
_LIBRARIES = ("mujoco", "dm_control", "numpy", "scipy")
# Packages whose objects an argument may contain: `_version` identifies their code.
_KNOWN = {"softgym_mj", *_LIBRARIES, "builtins", "collections", "copyreg", "functools"}
_LARGEST = 5e6  # Size of the largest state that is kept [bytes]; cloths have 2 MB.
_KEPT = 7 * 86_400.0  # [s] Time after which unchanged states of another version are deleted.
_LEVEL = 1  # Compression level: cloths shrink to a seventh in a tenth of their simulation time.


class StartFiles(Store):
    """Initial states by variation, as nested dicts of arrays, of one set of arguments."""

    def __init__(self, pickled: bytes):
        """Opens the folder of these arguments; deletes old ones of other versions of the package.

        Args:
            pickled: Arguments that determine the initial states, by cloudpickle.
        """
        arguments = hashlib.sha256(pickled).hexdigest()
        parent, version = cache_folder() / "initial_states", _version()
        for folder in parent.glob("*"):
            if not folder.name.startswith(version[:12]):
                with contextlib.suppress(OSError):  # Another process deletes it, too.
                    if folder.stat().st_mtime < time.time() - _KEPT:
                        shutil.rmtree(folder, ignore_errors=True)
        specification = {"version": version, "arguments": arguments}
        super().__init__(parent / f"{version[:12]}-{arguments[:12]}", specification, CODEC)

    def put(self, key: Key, value: dict[str, Any]) -> None:
        """Stores a state unless it is too large."""
        if sum(np.asarray(array).nbytes for *_, array in leaves(value)) <= _LARGEST:
            super().put(key, value)

    def find(self, key: Key) -> dict[str, Any] | None:
        """Returns a state; None if there is none that can be read."""
        try:
            return self.get(key)
        except (FileNotFoundError, StoreError):
            return None


def start_files(pickled: bytes, task: type) -> StartFiles | None:
    """Returns the files of these arguments, or None if they depend on code of others.

    Args:
        pickled: As of `StartFiles`.
        task: Class of the task.
    """
    found = _Packages(io.BytesIO(pickled))
    found.load()
    own = {task.__module__.partition(".")[0], *found.names} <= _KNOWN
    return StartFiles(pickled) if own else None


class _Packages(pickle.Unpickler):
    """Collects the packages of the objects in a pickle."""

    def __init__(self, file: io.BytesIO):
        super().__init__(file)
        self.names: set[str] = set()

    def find_class(self, module_name: str, global_name: str) -> Any:
        self.names.add(module_name.partition(".")[0])
        return super().find_class(module_name, global_name)


@functools.cache
def _version() -> str:
    """Returns a digest of this package's files and of the versions of what it computes with."""
    digest = hashlib.sha256()
    for file in sorted(_PACKAGE.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            digest.update(str(file.relative_to(_PACKAGE)).encode() + file.read_bytes())
    for name in _LIBRARIES:
        digest.update(importlib.metadata.version(name).encode())
    return digest.hexdigest()


def _encode(values: Mapping[str, Any]) -> bytes:
    """Returns a line of JSON with types and shapes, and the numbers."""
    numbers = []

    def layout(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {name: layout(inner) for name, inner in value.items()}
        array = np.asarray(value)
        numbers.append(array.tobytes())
        return array.dtype.str, array.shape

    head = json.dumps(layout(values)).encode()
    return zlib.compress(head + b"\n" + b"".join(numbers), _LEVEL)


def _decode(content: bytes) -> dict[str, Any]:
    whole = zlib.decompress(content)
    end = whole.index(b"\n")
    at = end + 1

    def array(layout: Any) -> Any:
        nonlocal at
        if isinstance(layout, dict):
            return {name: array(inner) for name, inner in layout.items()}
        found = np.ndarray(layout[1], layout[0], whole, at)
        at += found.nbytes
        return found.copy()  # Arrays are freed one by one: batches share models and distances.

    return array(json.loads(whole[:end]))


CODEC = Codec(_encode, _decode)  # Much faster than .npz for many small arrays.
