"""Atomic reading and writing of files; failures are raised as `StoreError`."""

import contextlib
import csv
import io
import json
import os
import pathlib
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from softgym_mj.exceptions import SoftGymError, StoreError


@contextlib.contextmanager
def naming(path: str | os.PathLike[str], action: str) -> Iterator[None]:
    """Raises errors of files as `StoreError`: "PATH cannot be ACTION" ("read" or "written")."""
    try:
        yield
    except SoftGymError:
        raise
    # Invalid paths, HDF5 and deeply nested JSON raise the last two.
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise StoreError(f"{path} cannot be {action}: {reason}") from error


def read_whole(file: str | os.PathLike[str]) -> bytes:
    """Returns the content of a file.

    Raises:
        StoreError: if there is no regular file: a pipe or a device may never end.
    """
    path = pathlib.Path(file)
    with naming(file, "read"):
        if path.exists() and not path.is_file():
            raise OSError("it is not a file")
        return path.read_bytes()


def make_folder(folder: pathlib.Path) -> None:
    """Creates a folder and its parents.

    Raises:
        StoreError: if it cannot be made.
    """
    with naming(folder, "written"):
        folder.mkdir(parents=True, exist_ok=True)


@contextlib.contextmanager
def whole(file: pathlib.Path) -> Iterator[pathlib.Path]:
    """Yields a temporary path that is renamed to `file` at the end; creates parent folders.

    A killed process leaves the old file or none, and its temporary file, which is hidden.

    Raises:
        StoreError: if it cannot be written, or if `file` exists and is no regular file.
    """
    partial = file.with_name(f".{file.name}.{secrets.token_hex(8)}.partial")
    with naming(file, "written"):
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.exists() and not file.is_file():
            raise OSError("it is not a file")
        try:
            yield partial
            with open(partial, "rb") as stream:
                os.fsync(stream.fileno())
            os.replace(partial, file)
        finally:
            partial.unlink(missing_ok=True)


def write_whole(file: pathlib.Path, content: bytes) -> None:
    """Writes a file atomically."""
    with whole(file) as partial:
        partial.write_bytes(content)


def write_json(file: pathlib.Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object atomically."""
    write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def read_json(file: pathlib.Path) -> dict[str, Any]:
    """Returns the JSON object in a file.

    Raises:
        StoreError: if it is not a JSON object.
    """
    with naming(file, "read"):
        content = json.loads(read_whole(file))
        if not isinstance(content, dict):
            raise ValueError("it is not a JSON object")
    return content


def write_csv(
    file: pathlib.Path, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]
) -> None:
    """Writes rows as comma-separated values with a header, atomically; None is an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(file, text.getvalue().encode())
