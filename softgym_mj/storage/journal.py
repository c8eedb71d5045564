"""`Journal`: what leads to a value, as it comes, so that work that was killed goes on within it."""

import hashlib
import json
import os
import pathlib
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import naming, read_whole, write_whole


class Journal:
    """A file of one line for each entry, which is JSON, with a checksum of all that came before.

    The first line says whose journal it is. So it is refused when it is altered or another's; a
    last line that was not finished is cut off.
    """

    def __init__(self, file: pathlib.Path, owner: str):
        """Names a file; nothing is read or written yet.

        Args:
            file: of this journal alone.
            owner: one line that differs from those of all other journals.
        """
        self._file, self._first = file, owner.encode() + b"\n"
        self._checksum = ""

    def read(self) -> list[Any]:
        """The entries.

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
        """Adds an entry to those that were read."""
        text = json.dumps(entry).encode() + b"\n"  # repr of floats is exact.
        with naming(self._file, "written"), open(self._file, "ab") as stream:
            stream.write(f"{self._next(text)} ".encode() + text)
            stream.flush()
            os.fsync(stream.fileno())

    def _next(self, text: bytes) -> str:
        """The checksum of an entry and of all before."""
        self._checksum = hashlib.sha256(self._checksum.encode() + text).hexdigest()
        return self._checksum
