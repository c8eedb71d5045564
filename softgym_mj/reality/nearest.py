"""How far points are from a surface of triangles, not from its vertices."""

import functools

import numpy as np
from scipy.spatial import cKDTree

_TINY = 1e-30  # [m^2] Against divisions by zero of triangles without an area.


class SurfaceDistance:
    """Distances of points from a mesh that moves.

    Of a point the triangles at its nearest vertex are tried: that is exact where the nearest point
    of the surface lies in one of these, as on grids and wherever triangles are not much longer than
    wide; elsewhere it is a little too far.
    """

    def __init__(self, triangles: np.ndarray):
        """Notes which triangles (m, 3) each vertex has; every vertex has to have one."""
        self._triangles = np.asarray(triangles)

    @functools.cached_property
    def _fans(self) -> np.ndarray:
        """Triangles at each vertex (n, most): where there are fewer, the first one again."""
        corners = self._triangles.ravel()
        order = np.argsort(corners, kind="stable")
        counts = np.bincount(corners)
        first = np.cumsum(counts) - counts
        number = np.minimum(np.arange(counts.max()), counts[:, None] - 1)
        return order[first[:, None] + number] // 3

    def __call__(self, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Distance (k,) [m] of each of points (k, 3) from the mesh with vertices (n, 3) [m]."""
        nearest = cKDTree(vertices).query(points)[1]
        corners = vertices[self._triangles[self._fans[nearest]]]
        squares = _squared_distances(points[:, None], corners)
        return np.sqrt(squares.min(axis=1))


def _squared_distances(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Squares (...) [m^2] of the distances of points (..., 3) from triangles (..., 3, 3)."""
    a, b, c = np.moveaxis(corners, -2, 0)
    ab, ac, ap = b - a, c - a, points - a
    normal = np.cross(ab, ac)
    square = np.maximum(_dot(normal, normal), _TINY)
    # Barycentric coordinates of the foot: inside if all are positive.
    v = _dot(np.cross(ap, ac), normal) / square
    w = _dot(np.cross(ab, ap), normal) / square
    inside = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)
    above = _dot(ap, normal) ** 2 / square
    sides = np.minimum(
        np.minimum(_squares_from_edge(ap, ab), _squares_from_edge(ap, ac)),
        _squares_from_edge(points - b, c - b),
    )
    return np.where(inside, above, sides)


def _squares_from_edge(offset: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Squares (...) of distances of points, (..., 3) from an edge's start, from that edge."""
    along = np.clip(_dot(offset, edge) / np.maximum(_dot(edge, edge), _TINY), 0.0, 1.0)
    rest = offset - along[..., None] * edge
    return _dot(rest, rest)


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", first, second)
