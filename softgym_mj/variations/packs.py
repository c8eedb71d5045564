"""Packs: start states of all variations in one file, as shipped in the package."""

import functools
import io
import pathlib
import zipfile
import zlib
from collections.abc import Sequence

import numpy as np

from softgym_mj import assets
from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import read_whole, write_whole

# Errors of numpy and zipfile for an invalid npz.
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


@functools.cache
def shipped(name: str, specification: str) -> list[np.ndarray] | None:
    """Returns the shipped states of a start; None if there are none of this specification."""
    file = pathlib.Path(assets.path("variations", f"{name}.npz"))
    if not file.exists() or str(*_read(file, "specification")) != specification:
        return None
    return read_pack(file, specification)


def _read(file: pathlib.Path, *names: str) -> list[np.ndarray]:
    found = read_whole(file)
    try:
        with np.load(io.BytesIO(found), allow_pickle=False) as content:
            return [content[name] for name in names]
    except _UNREADABLE as error:
        raise corrupt(file, repr(error)) from error


def corrupt(file: pathlib.Path, reason: str) -> StoreError:
    """Returns the error for a file of start states."""
    return StoreError(
        f"{file} is not a valid store of initial states ({reason}). Generate it again with "
        "`softgym-mj generate TASK`, which replaces invalid files and keeps valid ones."
    )


def write_pack(file: pathlib.Path, states: Sequence[np.ndarray], specification: str) -> None:
    """Writes vertex positions [(n, 3) float32, ...] to an npz, atomically and byte-reproducibly."""
    counts = np.array([len(state) for state in states], np.int32)
    vertices = np.concatenate(states).astype(np.float32)
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        specification=specification,
        counts=counts,
        vertices=vertices,
    )
    write_whole(file, buffer.getvalue())


def read_pack(file: pathlib.Path, specification: str) -> list[np.ndarray]:
    """Reads a file of `write_pack`: a list of (n, 3) float64 arrays [m].

    Raises:
        StoreError: if it is truncated, altered (by zip's checksums) or of another specification.
    """
    found, counts, vertices = _read(file, "specification", "counts", "vertices")
    if str(found) != specification:
        raise corrupt(file, f"it holds {found}, expected {specification}")
    return [np.asarray(part, float) for part in np.split(vertices, np.cumsum(counts)[:-1])]
