"""`Store`: values by key, a file each, so that work that was killed goes on from what is there.

A file has a line of JSON with the digest of the specification, the key and the checksum of the
content, which follows. So it is refused when it is truncated or altered, was made under other
settings or lies in the place of another key.
"""

import hashlib
import io
import json
import os
import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from softgym_mj.exceptions import SoftGymError, StoreError
from softgym_mj.parallel.executors import Executor, SerialExecutor
from softgym_mj.storage.files import read_json, read_whole, write_json, write_whole
from softgym_mj.storage.journal import Journal

Key = int | str | tuple[int | str, ...]

_SHOWN = 300  # Bytes of a wrong header in a message.


class Codec(NamedTuple):
    """How values become bytes, the same for the same value, and come back."""

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


def _damaged(file: pathlib.Path, reason: str) -> SoftGymError:
    return StoreError(f"{file} cannot be read: {reason}; delete it")


class Store:
    """A folder of values that all belong to one specification.

    Attributes:
        folder: where the files are.
        text: the specification as JSON.
        digest: SHA-256 of that.
    """

    def __init__(
        self,
        folder: pathlib.Path,
        specification: Mapping[str, Any],
        codec: Codec,
        damaged: Callable[[pathlib.Path, str], SoftGymError] = _damaged,
    ):
        """Names a folder; nothing is read or written yet.

        Args:
            folder: of this store alone.
            specification: everything, JSON-able, that a value depends on besides its key.
            codec: `ARRAYS` or `JSON`.
            damaged: the error for a file and what is wrong with it.
        """
        self._specification = json.loads(json.dumps(specification))  # Tuples are lists there.
        self.text = json.dumps(self._specification, sort_keys=True)
        self.digest = hashlib.sha256(self.text.encode()).hexdigest()
        self.folder, self._codec, self._damaged = folder, codec, damaged
        self._claimed = False

    @property
    def _claim(self) -> pathlib.Path:
        return self.folder / "specification.json"

    def is_empty(self) -> bool:
        """Whether the folder holds nothing but a specification."""
        return all(file == self._claim for file in self.folder.glob("[!.]*"))

    def differences(self) -> list[str]:
        """The parts of the specification that are others for what the folder holds.

        Raises:
            StoreError: if the folder's specification is damaged.
        """
        if self.is_empty() or not self._claim.exists():
            return []
        result, own = read_json(self._claim), self._specification
        return [name for name in {**own, **result} if result.get(name) != own.get(name)]

    def claim(self) -> None:
        """Writes the specification into the folder, as the first `put` does."""
        write_json(self._claim, self._specification)
        self._claimed = True

    def file(self, key: Key) -> pathlib.Path:
        """The file of a key: "0004.value", "0800_0000.value"."""
        parts = key if isinstance(key, tuple) else (key,)
        names = [f"{part:04d}" if isinstance(part, int) else part for part in parts]
        return self.folder / f"{'_'.join(names)}.value"

    def has(self, key: Key) -> bool:
        """Whether there is a file of this key, whatever is in it."""
        return os.path.lexists(self.file(key))

    def get(self, key: Key) -> Any:
        """The value of a key.

        Raises:
            FileNotFoundError: if there is none.
            SoftGymError: the store's own for a file that is damaged, or of another specification
                or key.
        """
        file = self.file(key)
        if not self.has(key):
            raise FileNotFoundError(file)
        header, _, content = read_whole(file).partition(b"\n")
        expected = self._header(key, content)
        if header != expected:
            shown = header[:_SHOWN].decode(errors="replace")
            raise self._damaged(file, f"it begins with {shown!r}, expected {expected.decode()!r}")
        return self._codec.decode(content)

    def put(self, key: Key, value: Any) -> None:
        """Keeps a value: its file is written whole or not at all."""
        if not self._claimed:
            self.claim()
        content = self._codec.encode(value)
        write_whole(self.file(key), self._header(key, content) + b"\n" + content)

    def journal(self, key: Key) -> Journal:
        """The journal of a value that is being made; the folder is this specification's."""
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
        """Makes the values that are missing; may be killed and run again.

        Args:
            keys: of all values.
            function: makes the value of a key, or of the parts of a key; as executors take it.
            executor: where it is called, which the files do not depend on; None for this process.
            progress: called with key and value of each file that is there; then, as they come, of
                each new one.
            replace: whether damaged files count as missing; else they are an error.

        Returns:
            How many values were made.
        """
        absent = (FileNotFoundError, SoftGymError) if replace else FileNotFoundError
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
