"""`Journal`: an append-only log of partial results, from which interrupted work continues."""

import hashlib
import json
import os
import pathlib
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import naming, read_whole, write_whole


class Journal:
    """File with one JSON entry a line and a checksum of all entries so far.

    The first line names the owner. Altered journals and those of other owners raise an error; an
    incomplete last line is removed.
    """

    def __init__(self, file: pathlib.Path, owner: str):
        """Sets the file of this journal alone; the line `owner` identifies the journal."""
        self._file, self._first = file, owner.encode() + b"\n"
        self._checksum = ""

    def read(self) -> list[Any]:
        """Returns the entries.

        Raises:
            StoreError: for another's journal or one that is damaged.
        """
        content = read_whole(self._file) if os.path.lexists(self._file) else b""
        lines = content[: content.rfind(b"\n") + 1].splitlines(keepends=True) or [self._first]
        if lines[0] != self._first:
            raise StoreError(f"{self._file} is of other work: {lines[0]!r}; delete it")
        self._checksum = hashlib.sha256(self._first).hexdigest()
        entries: list[Any] = []
        for line in lines[1:]:
            checksum, _, text = line.partition(b" ")
            if checksum.decode(errors="replace") != self._next(text):
                raise StoreError(f"{self._file} is damaged at entry {len(entries)}; delete it")
            entries.append(json.loads(text))
        if content != b"".join(lines):
            write_whole(self._file, b"".join(lines))
        return entries

    def append(self, entry: Any) -> None:
        """Appends an entry to the file, after `read`."""
        text = json.dumps(entry).encode() + b"\n"  # repr of floats is exact.
        with naming(self._file, "written"), open(self._file, "ab") as stream:
            stream.write(f"{self._next(text)} ".encode() + text)
            stream.flush()
            os.fsync(stream.fileno())

    def _next(self, text: bytes) -> str:
        """Returns the checksum of an entry and all before it."""
        self._checksum = hashlib.sha256(self._checksum.encode() + text).hexdigest()
        return self._checksum
