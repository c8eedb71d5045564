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
        return np.linalg.norm(self.offsets(points, vertices), axis=1)

    def offsets(self, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """The ways (k, 3) [m] from the nearest points of the mesh to points (k, 3)."""
        nearest = cKDTree(vertices).query(points)[1]
        corners = vertices[self._triangles[self._fans[nearest]]]
        offsets = _offsets(points[:, None], corners)
        least = _dot(offsets, offsets).argmin(axis=1)
        return offsets[np.arange(len(points)), least]


def _offsets(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Ways (..., 3) [m] to points (..., 3) from the nearest ones of triangles (..., 3, 3)."""
    a, b, c = np.moveaxis(corners, -2, 0)
    ab, ac, ap = b - a, c - a, points - a
    normal = np.cross(ab, ac)
    square = np.maximum(_dot(normal, normal), _TINY)
    # Barycentric coordinates of the foot: inside if all are positive.
    v = _dot(np.cross(ap, ac), normal) / square
    w = _dot(np.cross(ab, ap), normal) / square
    inside = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)
    best = _from_edge(ap, ab)
    for other in (_from_edge(ap, ac), _from_edge(points - b, c - b)):
        nearer = _dot(other, other) < _dot(best, best)
        best = np.where(nearer[..., None], other, best)
    above = (_dot(ap, normal) / square)[..., None] * normal
    return np.where(inside[..., None], above, best)


def _from_edge(offset: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Ways (..., 3) to points, (..., 3) from an edge's start, from the nearest of that edge."""
    along = np.clip(_dot(offset, edge) / np.maximum(_dot(edge, edge), _TINY), 0.0, 1.0)
    return offset - along[..., None] * edge


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", first, second)
