"""`MeshDistances`: distances of vertices along the edges of a mesh."""

import functools
from typing import NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph


class PairDistances(NamedTuple):
    """Distances of all pairs of vertices.

    Attributes:
        indices: index into `distances` of vertices i >= j, at i (i + 1) / 2 + j
            (num_points (num_points + 1) / 2,), of the smallest unsigned type.
        distances: different distances, ascending [m]; a sheet has few.
    """

    indices: np.ndarray
    distances: np.ndarray


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

    @functools.cached_property
    def pairs(self) -> PairDistances:
        """Distances of all pairs."""
        # The upper triangle: rounding depends on the direction.
        distances = scipy.sparse.csgraph.dijkstra(self._mesh, directed=False).T
        each = distances[np.tril_indices(len(distances))]
        different, indices = np.unique(each, return_inverse=True)
        return PairDistances(indices.astype(np.min_scalar_type(len(different))), different)
