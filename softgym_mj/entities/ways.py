"""`Ways`: how far vertices of a mesh are from each other along its edges."""

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
        self._mesh = num_points, edges, lengths
        self._from: dict[int, np.ndarray] = {}

    def between(self, first: int, second: int) -> float:
        """The way from one vertex to another [m]; infinite if nothing connects them."""
        start, end = min(first, second), max(first, second)  # Sums depend on the direction.
        if start not in self._from:
            number, edges, lengths = self._mesh
            mesh = scipy.sparse.csr_array((lengths, tuple(edges.T)), shape=(number, number))
            self._from[start] = scipy.sparse.csgraph.dijkstra(mesh, directed=False, indices=start)
        return float(self._from[start][end])
