"""Initial states on disk, so that the next training of a task need not make them again."""

import functools
import hashlib
import importlib.metadata
import io
import pathlib
import pickle
import shutil
from typing import Any

import numpy as np

from softgym_mj.native.caches import cache_folder
from softgym_mj.storage.store import ARRAYS, Key, Store

_PACKAGE = pathlib.Path(__file__).parents[2]
_LIBRARIES = ("mujoco", "dm_control", "numpy", "scipy")
# Packages whose objects an argument may contain: `_version` identifies their code.
_KNOWN = {"softgym_mj", *_LIBRARIES, "builtins", "collections", "copyreg", "functools"}
_JOINT = "/"  # Between the names of nested dicts.
_LARGEST = (
    250e3  # Size [bytes] of a state above which reading a file saves little: cloths have 2 MB.
)


class StartFiles(Store):
    """Initial states by variation, as nested dicts of arrays, of one set of arguments."""

    def __init__(self, pickled: bytes):
        """Opens the folder of these arguments and deletes those of other versions of the package.

        Args:
            pickled: Arguments that determine the initial states, by cloudpickle.
        """
        arguments = hashlib.sha256(pickled).hexdigest()
        parent, version = cache_folder() / "initial_states", _version()
        for folder in parent.glob("*"):
            if not folder.name.startswith(version[:12]):
                shutil.rmtree(folder, ignore_errors=True)
        specification = {"version": version, "arguments": arguments}
        super().__init__(parent / f"{version[:12]}-{arguments[:12]}", specification, ARRAYS)

    def get(self, key: Key) -> dict[str, Any]:
        nested: dict[str, Any] = {}
        for path, array in super().get(key).items():
            *parents, name = path.split(_JOINT)
            parent = functools.reduce(lambda d, part: d.setdefault(part, {}), parents, nested)
            if name:
                parent[name] = array
        return nested

    def put(self, key: Key, value: dict[str, Any]) -> None:
        arrays = _flat(value)
        if sum(array.nbytes for array in arrays.values()) <= _LARGEST:
            super().put(key, arrays)


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


def _flat(values: dict[str, Any]) -> dict[str, np.ndarray]:
    """Returns arrays by joined names; an empty dict has an entry without a last name."""
    found: dict[str, np.ndarray] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            inner = _flat(value) or {"": np.zeros(0)}
            found |= {f"{name}{_JOINT}{path}": array for path, array in inner.items()}
        else:
            found[name] = np.asarray(value)
    return found
