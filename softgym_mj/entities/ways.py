"""`Ways`: how far vertices of a mesh are from each other along its edges."""

import functools

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph


class Ways:
    """The shortest ways along the edges of a mesh at rest, found when they are first asked for."""

    def __init__(self, num_points: int, edges: np.ndarray, lengths: np.ndarray):
        """Notes a mesh.

        Args:
            num_points: number of vertices.
            edges: their indices (num_edges, 2).
            lengths: of the edges at rest (num_edges,) [m].
        """
        self._shape, self._edges, self._lengths = (num_points, num_points), edges, lengths
        self._from: dict[int, np.ndarray] = {}

    @functools.cached_property
    def _mesh(self) -> scipy.sparse.csr_array:
        return scipy.sparse.csr_array((self._lengths, tuple(self._edges.T)), shape=self._shape)

    def between(self, first: int, second: int) -> float:
        """The way from one vertex to another [m]; infinite if nothing connects them."""
        start, end = min(first, second), max(first, second)  # Sums depend on the direction.
        if start not in self._from:
            self._from[start] = scipy.sparse.csgraph.dijkstra(
                self._mesh, directed=False, indices=start
            )
        return float(self._from[start][end])

    def all(self) -> np.ndarray:
        """What `between` says of all pairs (num_points, num_points) [m]."""
        return self._all

    @functools.cached_property
    def _all(self) -> np.ndarray:
        ways = np.triu(scipy.sparse.csgraph.dijkstra(self._mesh, directed=False))
        return np.maximum(ways, ways.T)
