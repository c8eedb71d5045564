"""Writes the start states of all variations of a task to one file, as shipped in the package.

`softgym-mj generate TASK --jobs 8` simulates those that are missing in the cache, then
`python -m tools.packs TASK FILE` packs them.
"""

import argparse
import io
import pathlib
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import StoreError
from softgym_mj.registry import find
from softgym_mj.storage.files import write_whole
from softgym_mj.variations.indices import NUM_VARIATIONS
from softgym_mj.variations.store import VariationStore


def write(file: pathlib.Path, states: Sequence[np.ndarray], specification: str) -> None:
    """Writes vertex positions [(n, 3) float32, ...] to an npz, atomically and byte-reproducibly."""
    counts = np.array([len(state) for state in states], np.int32)
    vertices = np.concatenate(states).astype(np.float32)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, specification=specification, counts=counts, vertices=vertices)
    write_whole(file, buffer.getvalue())


def pack(store: VariationStore, file: pathlib.Path) -> None:
    """Writes all variations of a store; `StoreError` if one is missing."""
    missing = [index for index in range(NUM_VARIATIONS) if not store.has(index)]
    if missing:
        raise StoreError(
            f"{store.file(missing[0])} is missing, and {len(missing) - 1} others of "
            f"{NUM_VARIATIONS}: generate them first"
        )
    write(file, [store.get(index) for index in range(NUM_VARIATIONS)], store.text)


def main() -> None:
    """Packs a task's start states."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("task")
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--fidelity", default="default")
    given = parser.parse_args()
    store = find(given.task).build(fidelity=given.fidelity).store
    assert store is not None, "the task stores no start states"
    pack(store, given.file)


if __name__ == "__main__":
    main()
