"""Files that are written whole or not at all; what cannot be read or written is a `StoreError`."""

import contextlib
import json
import os
import pathlib
import secrets
import stat
from collections.abc import Iterator, Mapping
from typing import Any

from softgym_mj.exceptions import SoftGymError, StoreError

try:
    import fcntl
except ImportError:  # On Windows, which has no such flag either.
    fcntl = None  # type: ignore[assignment]
NONBLOCK = getattr(os, "O_NONBLOCK", 0)  # With it a pipe is opened at once.
PARTIAL = ".{}.{}.partial"  # Name of a file while it is written.


@contextlib.contextmanager
def naming(path: str | os.PathLike[str], action: str) -> Iterator[None]:
    """Raises what the system has against reading or writing files as a `StoreError`.

    Args:
        path: what the error names.
        action: "read" or "written".
    """
    try:
        yield
    except SoftGymError:
        raise
    except (
        OSError,
        ValueError,
        RuntimeError,
    ) as error:  # The latter of odd paths, HDF5 and deep JSON.
        reason = getattr(error, "strerror", None) or error
        raise StoreError(f"{path} cannot be {action}: {reason}") from error


def read_whole(file: str | os.PathLike[str]) -> bytes:
    """The content of a file.

    Raises:
        StoreError: if there is none, or something else: a pipe or a device may never end.
    """
    with (
        naming(file, "read"),
        open(file, "rb", opener=lambda path, flags: os.open(path, flags | NONBLOCK)) as stream,
    ):
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError("it is not a file")
        return stream.read()


def make_folder(folder: pathlib.Path) -> None:
    """Makes a folder and those around it; before work whose results it is for.

    Raises:
        StoreError: if it cannot be made.
    """
    with naming(folder, "written"):
        folder.mkdir(parents=True, exist_ok=True)


@contextlib.contextmanager
def whole(file: pathlib.Path) -> Iterator[pathlib.Path]:
    """Gives a path to write to, which becomes `file` in the end; makes the folders around it.

    Whoever is killed leaves the old file or none; the next one to write there tidies up.

    Raises:
        StoreError: if it cannot be written, or something else is there: it would be replaced.
    """
    partial = file.with_name(PARTIAL.format(file.name, secrets.token_hex(8)))
    with naming(file, "written"):
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.exists() and not file.is_file():
            raise OSError("it is not a file")
        with _among_writers(file.parent):
            try:
                yield partial
                with open(partial, "rb") as stream:
                    os.fsync(stream.fileno())
                os.replace(partial, file)
            finally:
                partial.unlink(missing_ok=True)


@contextlib.contextmanager
def _among_writers(folder: pathlib.Path) -> Iterator[None]:
    """Shares a lock, which ends with its process: who has it alone removes what the killed left."""
    if fcntl is None:
        yield
        return
    lock = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # Somebody writes, or this file system has no locks.
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for partial in folder.glob(PARTIAL.format("*", "*")):
                partial.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_SH)
        yield
    finally:
        os.close(lock)


def write_whole(file: pathlib.Path, content: bytes) -> None:
    """Writes a file as `whole` does."""
    with whole(file) as partial:
        partial.write_bytes(content)


def write_json(file: pathlib.Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object as `whole` does."""
    write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def read_json(file: pathlib.Path) -> dict[str, Any]:
    """Reads what `write_json` wrote.

    Raises:
        StoreError: if it is no JSON object.
    """
    with naming(file, "read"):
        content = json.loads(read_whole(file))
        if not isinstance(content, dict):
            raise ValueError("it is no JSON object")
    return content
