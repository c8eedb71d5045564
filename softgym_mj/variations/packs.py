"""Packs: start states of all variations in one file, as shipped in the package."""

import functools
import io
import pathlib
import zipfile
import zlib

import numpy as np

from softgym_mj import assets
from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import read_whole

# Errors of numpy and zipfile for an invalid npz.
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


@functools.cache
def shipped(name: str, specification: str) -> list[np.ndarray] | None:
    """Returns the shipped states of a start; None if there are none of this specification."""
    file = pathlib.Path(assets.path("variations", f"{name}.npz"))
    return read_pack(file, specification) if file.exists() else None


def read_pack(file: pathlib.Path, specification: str) -> list[np.ndarray] | None:
    """Reads a pack: a list of (n, 3) float64 arrays [m]; None if it is of another specification.

    Raises:
        StoreError: if it is truncated or altered, by zip's checksums.
    """
    content = read_whole(file)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as pack:
            if str(pack["specification"]) != specification:
                return None
            counts, vertices = pack["counts"], pack["vertices"]
    except _UNREADABLE as error:
        raise corrupt(file, repr(error)) from error
    return [np.asarray(part, float) for part in np.split(vertices, np.cumsum(counts)[:-1])]


def corrupt(file: pathlib.Path, reason: str) -> StoreError:
    """Returns the error for a file of start states."""
    return StoreError(
        f"{file} is not a valid store of initial states ({reason}). Generate it again with "
        "`softgym-mj generate TASK`, which replaces invalid files and keeps valid ones."
    )
