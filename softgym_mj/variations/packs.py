"""Packs: start states of all variations in one file, as shipped in the package."""

import functools
import pathlib

import numpy as np

from softgym_mj import assets


@functools.cache
def shipped(name: str, specification: str) -> list[np.ndarray] | None:
    """Returns the shipped states of a start; None if there are none of this specification."""
    file = pathlib.Path(assets.path("variations", f"{name}.npz"))
    return read_pack(file, specification) if file.exists() else None


def read_pack(file: pathlib.Path, specification: str) -> list[np.ndarray] | None:
    """Reads a pack: a list of (n, 3) float64 arrays [m]; None if it is of another specification."""
    with np.load(file, allow_pickle=False) as pack:
        if str(pack["specification"]) != specification:
            return None
        counts, vertices = pack["counts"], pack["vertices"]
    return [np.asarray(part, float) for part in np.split(vertices, np.cumsum(counts)[:-1])]
