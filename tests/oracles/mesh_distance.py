"""Exact signed distances to triangle meshes, in NumPy."""

import numpy as np
from scipy.spatial import cKDTree
from trimesh.triangles import closest_point

_NEAREST = 32  # Triangles with the nearest centers, which are checked for each point.


def mesh_distance(
    points: np.ndarray, vertices: np.ndarray, faces: np.ndarray, is_closed: bool = True
) -> np.ndarray:
    """Returns distances (n,) [m] of points near a mesh of similar triangles.

    They are negative inside a closed mesh, where the winding number is not 0.
    """
    corners = vertices[faces]
    count = min(_NEAREST, len(faces))
    _, nearest = cKDTree(corners.mean(axis=1)).query(points, count)
    a, b, c = np.moveaxis(corners[nearest], 2, 0)
    repeated = np.repeat(points, count, axis=0)
    off = repeated - closest_point(corners[nearest].reshape(-1, 3, 3), repeated)
    off = off.reshape(a.shape)
    squares = _dot(off, off)
    best = squares.argmin(axis=1)[:, None, None]
    distance = np.sqrt(squares.min(axis=1))
    if is_closed:
        # Points in front of the nearest triangle are outside, those behind it may be at an edge.
        normal = np.take_along_axis(np.cross(b - a, c - a), best, 1)[:, 0]
        way = np.take_along_axis(off, best, 1)[:, 0]
        behind = np.flatnonzero(_dot(way, normal) < 0.0)
        inside = behind[np.abs(_winding(points[behind], corners)) > 0.5]
        distance[inside] *= -1.0
    return distance


def _winding(points, corners):
    """Winding numbers (Van Oosterom and Strackee, 1983)."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    size = [np.linalg.norm(x, axis=-1) for x in (a, b, c)]
    below = size[0] * size[1] * size[2]
    below = below + _dot(a, b) * size[2] + _dot(b, c) * size[0] + _dot(c, a) * size[1]
    return np.arctan2(_dot(a, np.cross(b, c)), below).sum(axis=-1) / (2.0 * np.pi)


def _dot(a, b):
    return (a * b).sum(axis=-1)
