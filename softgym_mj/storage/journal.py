"""`Journal`: an append-only log of partial results, from which interrupted work continues."""

import json
import os
import pathlib
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import naming, read_whole, write_whole


class Journal:
    """File with one JSON entry a line, after a line that names the owner."""

    def __init__(self, file: pathlib.Path, owner: str):
        """Sets the file of this journal alone; the line `owner` identifies the journal."""
        self._file, self._first = file, owner.encode() + b"\n"

    def read(self) -> list[Any]:
        """Returns the entries; an incomplete last line is removed.

        Raises:
            StoreError: for another's journal or one that is damaged.
        """
        content = read_whole(self._file) if os.path.lexists(self._file) else b""
        lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True) or [self._first]
        if lines[0] != self._first:
            raise StoreError(f"{self._file} belongs to other work, {lines[0]!r}; delete it")
        if content != b"".join(lines):
            write_whole(self._file, b"".join(lines))
        with naming(self._file, "read"):
            return [json.loads(line) for line in lines[1:]]

    def append(self, entry: Any) -> None:
        """Appends an entry to the file, after `read`."""
        with naming(self._file, "written"), open(self._file, "ab") as stream:
            stream.write(json.dumps(entry).encode() + b"\n")  # repr of floats is exact.
            stream.flush()
            os.fsync(stream.fileno())
