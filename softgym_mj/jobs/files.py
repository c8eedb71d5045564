"""Files that are written whole or not at all."""

import os
import pathlib
import secrets

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
