"""Distances of points from a triangle mesh: from its surface, not its vertices."""

import functools

import numpy as np
from scipy.spatial import cKDTree

_TINY = 1e-30  # [m^2] Avoids division by zero for degenerate triangles.


class SurfaceDistance:
    """Distances of points from a mesh that moves.

    For each point, the triangles at its nearest vertex are tested. This is exact if the nearest
    surface point lies in one of them, as on grids and wherever triangles are not much longer than
    wide; otherwise the distance is slightly too large.
    """

    def __init__(self, triangles: np.ndarray):
        """Stores the triangles (m, 3); every vertex must belong to one."""
        self._triangles = np.asarray(triangles)

    @functools.cached_property
    def _fans(self) -> np.ndarray:
        """Triangles at each vertex (n, most); shorter lists repeat their first one."""
        corners = self._triangles.ravel()
        order = np.argsort(corners, kind="stable")
        counts = np.bincount(corners)
        first = np.cumsum(counts) - counts
        number = np.minimum(np.arange(counts.max()), counts[:, None] - 1)
        return order[first[:, None] + number] // 3

    def __call__(self, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Returns the distance (k,) [m] of points (k, 3) from the mesh with vertices (n, 3) [m]."""
        return np.linalg.norm(self.displacements(points, vertices), axis=1)

    def displacements(self, points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
        """Returns displacements (k, 3) [m] of points (k, 3) from the mesh with vertices (n, 3)."""
        nearest = cKDTree(vertices).query(points)[1]
        corners = vertices[self._triangles[self._fans[nearest]]]
        displacements = _displacements(points[:, None], corners)
        least = _dot(displacements, displacements).argmin(axis=1)
        return displacements[np.arange(len(points)), least]


def _displacements(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns displacements (..., 3) [m] of points (..., 3) from triangles (..., 3, 3)."""
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


def _from_edge(displacement: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Returns displacements (..., 3) from the nearest point of an edge.

    Args:
        displacement: (..., 3) from the start of the edge.
        edge: (..., 3).
    """
    along = np.clip(_dot(displacement, edge) / np.maximum(_dot(edge, edge), _TINY), 0.0, 1.0)
    return displacement - along[..., None] * edge


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", first, second)
