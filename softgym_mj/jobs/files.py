"""Files that are written whole or not at all."""

import json
import os
import pathlib
import secrets
from collections.abc import Mapping
from typing import Any

from softgym_mj.exceptions import StoreError

PARTIAL = ".{}.{}.partial"  # Name of a file while it is written.


def write_whole(file: pathlib.Path, content: bytes) -> None:
    """Writes a file, with the folders around it; whoever is killed leaves the old one or none."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(PARTIAL.format(file.name, secrets.token_hex(8)))
    try:
        with open(partial, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(partial, file)
    finally:
        partial.unlink(missing_ok=True)


def write_json(file: pathlib.Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object as `write_whole` does."""
    write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def read_json(file: pathlib.Path) -> dict[str, Any]:
    """Reads what `write_json` wrote.

    Raises:
        StoreError: if it is no JSON object.
    """
    try:
        content = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise StoreError(f"{file} cannot be read: {error}") from error
    if not isinstance(content, dict):
        raise StoreError(f"{file} is not a result")
    return content
