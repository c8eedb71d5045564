"""`MeshDistances`: distances of vertices along the edges of a mesh."""

import functools

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph


class MeshDistances:
    """Shortest paths along the edges of a mesh at rest, computed on first use."""

    def __init__(self, num_points: int, edges: np.ndarray, lengths: np.ndarray):
        """Stores a mesh.

        Args:
            num_points: number of vertices.
            edges: vertex indices (num_edges, 2) of the edges.
            lengths: rest lengths of the edges (num_edges,) [m].
        """
        self._shape, self._edges, self._lengths = (num_points, num_points), edges, lengths
        self._from: dict[int, np.ndarray] = {}

    @functools.cached_property
    def _mesh(self) -> scipy.sparse.csr_array:
        return scipy.sparse.csr_array((self._lengths, tuple(self._edges.T)), shape=self._shape)

    def between(self, first: int, second: int) -> float:
        """Returns the distance of two vertices [m]; infinite if nothing connects them."""
        start, end = min(first, second), max(first, second)  # Rounding depends on the direction.
        if start not in self._from:
            self._from[start] = scipy.sparse.csgraph.dijkstra(
                self._mesh, directed=False, indices=start
            )
        return float(self._from[start][end])

    def all(self) -> np.ndarray:
        """Returns the distances of all pairs (num_points, num_points) [m]."""
        return self._all

    @functools.cached_property
    def _all(self) -> np.ndarray:
        distances = np.triu(scipy.sparse.csgraph.dijkstra(self._mesh, directed=False))
        return np.maximum(distances, distances.T)
