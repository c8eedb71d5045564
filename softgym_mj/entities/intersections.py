"""Self-intersections of a mesh."""

import numpy as np


def count_intersections(vertices: np.ndarray, edges: np.ndarray, triangles: np.ndarray) -> int:
    """Returns the number of intersecting (edge, triangle) pairs that share no vertex.

    Args:
        vertices: (n, 3) positions [m].
        edges: (k, 2) vertex indices.
        triangles: (m, 3) vertex indices.
    """
    count = 0
    corners = vertices[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    ends = vertices[edges]
    edge_low, edge_high = ends.min(axis=1), ends.max(axis=1)
    for block in np.array_split(np.arange(len(edges)), max(1, len(edges) // 256)):
        near = np.all(edge_low[block, None] <= high, axis=2) & np.all(
            edge_high[block, None] >= low, axis=2
        )
        edge, triangle = np.nonzero(near)
        edge = block[edge]
        shared = np.any(edges[edge][:, :, None] == triangles[triangle][:, None, :], axis=(1, 2))
        edge, triangle = edge[~shared], triangle[~shared]
        count += int(np.count_nonzero(_segment_hits(ends[edge], corners[triangle])))
    return count


def _segment_hits(segments: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns whether each segment (n, 2, 3) crosses the triangle (n, 3, 3) of the same row."""
    start, direction = segments[:, 0], segments[:, 1] - segments[:, 0]
    side_a, side_b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # Moeller and Trumbore (1997): solve start + t direction = corner + u side_a + v side_b.
    p = np.cross(direction, side_b)
    determinant = np.einsum("ij,ij->i", side_a, p)
    parallel = np.abs(determinant) < 1e-14
    inverse = 1.0 / np.where(parallel, 1.0, determinant)
    offset = start - corners[:, 0]
    u = np.einsum("ij,ij->i", offset, p) * inverse
    q = np.cross(offset, side_a)
    v = np.einsum("ij,ij->i", direction, q) * inverse
    t = np.einsum("ij,ij->i", side_b, q) * inverse
    return ~parallel & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
