"""`Store`: values by key, one file each, so that interrupted work continues from finished values.

A file has a JSON line with the digest of the specification, the key and the checksum of the
content, then the content. A file that is truncated, altered, renamed or of another specification
raises an error.
"""

import hashlib
import io
import json
import os
import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from softgym_mj.exceptions import StoreError
from softgym_mj.parallel.executors import Executor, SerialExecutor
from softgym_mj.storage.files import read_json, read_whole, write_json, write_whole
from softgym_mj.storage.journal import Journal

Key = int | str | tuple[int | str, ...]

_SHOWN = 300  # Maximum number of bytes of a wrong header in a message.


class Codec(NamedTuple):
    """Deterministic encoding of values as bytes, and its inverse."""

    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]


def _arrays_to_npz(arrays: Mapping[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]  # No name is `allow_pickle`.
    return buffer.getvalue()


def _npz_to_arrays(content: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return dict(arrays)


ARRAYS = Codec(_arrays_to_npz, _npz_to_arrays)  # Arrays by name.
JSON = Codec(lambda value: json.dumps(value, indent=2).encode() + b"\n", json.loads)


class Store:
    """Folder of values of one specification.

    Attributes:
        folder: Folder of the files.
        text: Specification as JSON.
        digest: SHA-256 of `text`.
    """

    def __init__(self, folder: pathlib.Path, specification: Mapping[str, Any], codec: Codec):
        """Sets the folder, without reading or writing it.

        Args:
            folder: Folder of this store alone.
            specification: All that a value depends on besides its key; JSON.
            codec: `ARRAYS` or `JSON`.
        """
        self._specification = json.loads(json.dumps(specification))  # JSON has no tuples.
        self.text = json.dumps(self._specification, sort_keys=True)
        self.digest = hashlib.sha256(self.text.encode()).hexdigest()
        self.folder, self._codec = folder, codec
        self._claimed = False

    @property
    def _claim(self) -> pathlib.Path:
        return self.folder / "specification.json"

    def is_empty(self) -> bool:
        """Returns whether the folder holds nothing but a specification."""
        return all(file == self._claim for file in self.folder.glob("[!.]*"))

    def claimed_for(self) -> dict[str, Any]:
        """Returns the specification of the folder's values; it is empty without values.

        Raises:
            StoreError: if it is damaged.
        """
        return {} if self.is_empty() or not self._claim.exists() else read_json(self._claim)

    def differences(self) -> list[str]:
        """Returns the entries of the specification that differ from those of the folder.

        Raises:
            StoreError: if the folder's specification is damaged.
        """
        result, own = self.claimed_for(), self._specification
        if not result:
            return []
        return [name for name in {**own, **result} if result.get(name) != own.get(name)]

    def claim(self) -> None:
        """Writes the specification into the folder, as the first `put` does."""
        write_json(self._claim, self._specification)
        self._claimed = True

    def file(self, key: Key) -> pathlib.Path:
        """Returns the file of a key: "0004.value", "0800_0000.value"."""
        parts = key if isinstance(key, tuple) else (key,)
        names = [f"{part:04d}" if isinstance(part, int) else part for part in parts]
        return self.folder / f"{'_'.join(names)}.value"

    def has(self, key: Key) -> bool:
        """Returns whether there is a file of this key, valid or not."""
        return os.path.lexists(self.file(key))

    def get(self, key: Key) -> Any:
        """Returns the value of a key.

        Raises:
            FileNotFoundError: if there is none.
            StoreError: for a file that is damaged or belongs to another specification or key.
        """
        file = self.file(key)
        if not self.has(key):
            raise FileNotFoundError(file)
        header, _, content = read_whole(file).partition(b"\n")
        expected = self._header(key, content)
        if header != expected:
            shown = header[:_SHOWN].decode(errors="replace")
            reason = f"it begins with {shown!r}, expected {expected.decode()!r}"
            raise StoreError(f"{file} cannot be read: {reason}; delete it")
        return self._codec.decode(content)

    def put(self, key: Key, value: Any) -> None:
        """Stores a value; its file is written atomically."""
        if not self._claimed:
            self.claim()
        content = self._codec.encode(value)
        write_whole(self.file(key), self._header(key, content) + b"\n" + content)

    def journal(self, key: Key) -> Journal:
        """Returns the journal of a value that is being computed."""
        owner = {"specification": self.digest, "key": key}
        return Journal(self.file(key).with_suffix(".jsonl"), json.dumps(owner))

    def _header(self, key: Key, content: bytes) -> bytes:
        checksum = hashlib.sha256(content).hexdigest()
        header = {"specification": self.digest, "key": key, "sha256": checksum}
        return json.dumps(header).encode()

    def run(
        self,
        keys: Iterable[Key],
        function: Callable,
        executor: Executor | None = None,
        progress: Callable[[Any, Any], None] = lambda key, value: None,
        *,
        replace: bool = False,
    ) -> int:
        """Computes and stores missing values; the same call continues an interrupted one.

        Args:
            keys: Keys of all values.
            function: Computes the value of a key, or of the parts of a key.
            executor: Executor of these calls; None for this process.
            progress: Called with key and value of each stored value, then of each new one.
            replace: Whether damaged files are replaced; otherwise they raise an error.

        Returns:
            Number of values that were computed.
        """
        absent = (FileNotFoundError, StoreError) if replace else FileNotFoundError
        missing: list[Key] = []
        for key in keys:
            try:
                value = self.get(key)
            except absent:
                missing.append(key)
            else:
                progress(key, value)
        calls = [key if isinstance(key, tuple) else (key,) for key in missing]
        for index, value in (executor or SerialExecutor()).results(function, calls):
            self.put(missing[index], value)
            progress(missing[index], value)
        return len(missing)
