"""`DistanceTables`: distances of the vertices of many meshes, on the device of a batch."""

from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.metrics import Array


class DistanceTables:
    """Distances of all pairs of vertices of meshes, as indices into the different distances."""

    def __init__(self, device: Device):
        """Makes empty tables."""
        self._device = device
        # Indices of distances by pair, and distances [m]; number of used entries of each.
        self._arrays = {
            "pairs": device.zeros((1,), "int32"),
            "distances": device.zeros((1,), "float64"),
        }
        self._used = {"pairs": 0, "distances": 0}
        self._first: dict[bytes, int] = {}  # Index of the first pair of a mesh.

    @property
    def size(self) -> int:
        """Sizes of the arrays together, which grow with replaced arrays."""
        return sum(map(len, self._arrays.values()))

    def add(self, key: bytes, indices: np.ndarray, distances: np.ndarray) -> int:
        """Returns the index of the first pair of a mesh.

        Args:
            key: Identifies the mesh.
            indices, distances: As in `PairDistances`.
        """
        if key not in self._first:
            self._first[key] = self._used["pairs"]
            self._append("pairs", indices.astype(np.int32) + self._used["distances"])
            self._append("distances", distances)
        return self._first[key]

    def _append(self, name: str, array: np.ndarray) -> None:
        old, first = self._arrays[name], self._used[name]
        last = self._used[name] = first + len(array)
        if last > len(old):
            dtype = str(old.dtype).rpartition(".")[2]
            self._arrays[name] = self._device.zeros((max(last, 2 * len(old)),), dtype)
            self._arrays[name][:first] = old[:first]
        self._arrays[name][first:last] = self._device.put(array)

    def between(self, first: Array, a: Array, b: Array) -> Any:
        """Returns distances [m] of vertices (num_envs,) of meshes by their first pairs."""
        xp = self._device.xp
        low, high = xp.minimum(a, b), xp.maximum(a, b)
        index = self._arrays["pairs"][first + high * (high + 1) // 2 + low]
        return self._arrays["distances"][xp.astype(index, xp.int64)]
