"""The store of settled start states: what takes simulation is generated once.

First comes the set shipped in the package, then the user's cache, one file a variation.
"""

import functools
import hashlib
import io
import json
import logging
import os
import pathlib
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable

import mujoco
import numpy as np

from softgym_mj import assets
from softgym_mj.exceptions import CacheUnavailableError, CorruptStoreError
from softgym_mj.jobs.executors import Executor, SerialExecutor
from softgym_mj.jobs.files import PARTIAL, write_whole
from softgym_mj.variations.indices import NUM_VARIATIONS, Initializer, check_variation

CACHE_VARIABLE = "SOFTGYM_MJ_CACHE"  # Overrides the cache folder.
_MUJOCO_SERIES = ".".join(mujoco.__version__.split(".")[:2])  # Results change between minors.

# What numpy and zipfile raise on a file that is not a whole npz of ours.
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip

_ABANDONED = 3600.0  # Age [s] of a partial file that nobody can still be writing.

_log = logging.getLogger(__name__)


def cache_folder() -> pathlib.Path:
    """Where generated states are kept: $SOFTGYM_MJ_CACHE or ~/.cache/softgym_mj."""
    if CACHE_VARIABLE in os.environ:
        return pathlib.Path(os.environ[CACHE_VARIABLE])
    root = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    return pathlib.Path(root) / "softgym_mj"


class VariationStore:
    """Settled initial states of one initializer, generated where missing."""

    def __init__(self, initializer: Initializer):
        self._initializer = initializer
        self._specification = json.dumps(
            {
                "initializer": initializer.name,
                "parameters": initializer.parameters,
                "mujoco": _MUJOCO_SERIES,
            },
            sort_keys=True,
        )
        digest = hashlib.sha256(self._specification.encode()).hexdigest()
        self._folder = cache_folder() / f"{initializer.name}-{digest[:12]}"

    @property
    def folder(self) -> pathlib.Path:
        """Cache folder of this initializer and its parameters."""
        return self._folder

    def file(self, index: int) -> pathlib.Path:
        """Cache file of a variation."""
        return self._folder / f"{check_variation(index):04d}.npz"

    def load(self, index: int) -> np.ndarray:
        """Vertex positions (n, 3) [m] of a variation; generated and stored if missing.

        Raises:
            CorruptStoreError: if the file is truncated, altered or of another specification.
            CacheUnavailableError: if it has to be generated and cannot be written.
        """
        states = self._shipped()
        if states is not None:
            return states[check_variation(index)].copy()
        file = self.file(index)
        if not file.exists():
            _log.info("generating variation %d of %s", index, self._initializer.name)
            self.generate(index)
        return read_states(file, self._specification)[0]

    def generate(self, index: int) -> None:
        """Simulates a variation and stores it."""
        self.save(index, self._initializer.generate(index))

    def save(self, index: int, points: np.ndarray) -> None:
        """Stores `points` (n, 3) [m] as a variation: its file is written whole or not at all.

        Raises:
            CacheUnavailableError: if it cannot be written.
        """
        try:
            write_states(self.file(index), [points.astype(np.float32)], self._specification)
        except OSError as error:
            raise CacheUnavailableError(
                f"{self.file(index)} cannot be written: {error}. Let {CACHE_VARIABLE} name a "
                "folder with space that can be written."
            ) from error

    def is_stored(self, index: int) -> bool:
        """Whether a valid file of this variation is in the cache."""
        try:
            read_states(self.file(index), self._specification)
        except (FileNotFoundError, CorruptStoreError):
            return False
        return True

    def generate_missing(
        self,
        indices: Iterable[int],
        executor: Executor | None = None,
        progress: Callable[[int], None] = lambda _: None,
    ) -> int:
        """Generates what is missing or corrupt; may be killed and resumed.

        Args:
            indices: variation indices.
            executor: where they are generated, which the files do not depend on; None for this
                process.
            progress: called with each index when its file is there.

        Returns:
            How many variations were generated.
        """
        self._remove_abandoned()
        missing = []
        for index in indices:
            if self.is_stored(index):
                progress(index)
            else:
                missing.append(index)
        calls = [(index,) for index in missing]
        for i, state in (executor or SerialExecutor()).results(self._initializer.generate, calls):
            self.save(missing[i], state)
            progress(missing[i])
        return len(missing)

    def _remove_abandoned(self):
        """Removes what a killed process left of a file it was writing."""
        for file in self._folder.glob(PARTIAL.format("*", "*")):
            if time.time() - file.stat().st_mtime > _ABANDONED:
                file.unlink(missing_ok=True)

    def pack(self, file: pathlib.Path) -> None:
        """Writes all variations into one file, as shipped in the package."""
        states = [
            read_states(self.file(index), self._specification)[0] for index in range(NUM_VARIATIONS)
        ]
        write_states(file, states, self._specification)

    def _shipped(self) -> list[np.ndarray] | None:
        return _shipped_states(self._initializer.name, self._specification)


@functools.cache
def _shipped_states(name: str, specification: str) -> list[np.ndarray] | None:
    file = pathlib.Path(assets.path("variations", f"{name}.npz"))
    if not file.exists() or _stored_specification(file) != specification:
        return None
    return read_states(file, specification)


def _stored_specification(file: pathlib.Path) -> str | None:
    try:
        with np.load(file, allow_pickle=False) as content:
            return str(content["specification"])
    except _UNREADABLE as error:
        raise _corrupt(file, repr(error)) from error


def _corrupt(file: pathlib.Path, reason: str) -> CorruptStoreError:
    return CorruptStoreError(
        f"{file} is not a valid store of initial states ({reason}). Generate it again with "
        "`softgym-mj generate TASK`, which replaces invalid files and keeps valid ones."
    )


def _checksum(specification: str, counts: np.ndarray, vertices: np.ndarray) -> str:
    digest = hashlib.sha256(specification.encode())
    digest.update(np.ascontiguousarray(counts).tobytes())
    digest.update(np.ascontiguousarray(vertices).tobytes())
    return digest.hexdigest()


def write_states(file: pathlib.Path, states: list[np.ndarray], specification: str) -> None:
    """Writes vertex positions [(n, 3) float32, ...] to an npz, atomically and byte-reproducibly."""
    counts = np.array([len(state) for state in states], np.int32)
    vertices = np.concatenate(states).astype(np.float32)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        specification=specification,
        checksum=_checksum(specification, counts, vertices),
        counts=counts,
        vertices=vertices,
    )
    write_whole(file, buffer.getvalue())


def read_states(file: pathlib.Path, specification: str) -> list[np.ndarray]:
    """Reads what `write_states` wrote: a list of (n, 3) float64 arrays [m].

    Raises:
        FileNotFoundError: if there is no such file.
        CorruptStoreError: if it is truncated, altered or of another specification.
    """
    if not file.exists():
        raise FileNotFoundError(file)
    try:
        with np.load(file, allow_pickle=False) as content:
            found, checksum = str(content["specification"]), str(content["checksum"])
            counts, vertices = content["counts"], content["vertices"]
    except _UNREADABLE as error:
        raise _corrupt(file, repr(error)) from error
    if found != specification:
        raise _corrupt(file, f"it holds {found}, expected {specification}")
    actual = _checksum(found, counts, vertices)
    if actual != checksum:
        raise _corrupt(file, f"checksum {actual[:12]}..., expected {checksum[:12]}...")
    return [
        np.asarray(part, float) for part in np.split(vertices, np.cumsum(counts)[:-1].astype(int))
    ]
