"""Share of an image that objects cover, without rendering: surface points on pixels."""

import itertools

import numpy as np

# Corners (8, 3) of a cube of side 2 about the origin, and its triangles (12, 3).
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
_SQUARES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
FACES = np.array([t for a, b, c, d in _SQUARES for t in ((a, b, c), (a, c, d))])


def boxes(corners: np.ndarray) -> np.ndarray:
    """Triangles (12 n, 3, 3) of boxes with corners (n, 8, 3) in the order of `CORNERS`."""
    return corners[:, FACES].reshape(-1, 3, 3)


def sampled(triangles: np.ndarray, number: int) -> np.ndarray:
    """Points (number, 3), evenly on triangles (n, 3, 3); none if there are no triangles."""
    if not len(triangles):
        return np.zeros((0, 3))
    random = np.random.default_rng(0)
    a, b, c = triangles.transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(triangles), number, p=areas / areas.sum())
    u, v = random.uniform(size=(2, number, 1))
    u, v = np.where(u + v > 1.0, [1.0 - u, 1.0 - v], [u, v])
    return a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]


def covered(
    points: np.ndarray, place: np.ndarray, axes: np.ndarray, half: float, side: int
) -> np.ndarray:
    """Pixels (side, side) bool in which points (n, 3) are seen.

    Args:
        points: in front of the camera or behind it.
        place: of the camera (3,).
        axes: (3, 3) of the camera, rows: right, up, backward.
        half: tangent of half its field of view.
        side: of the picture [pixels].
    """
    right, up, back = axes @ (points - place).T
    depth = np.maximum(-back, 1e-6)
    pixels = np.floor((np.array([up, right]) / (half * depth) + 1.0) * side / 2.0)
    row, column = pixels[:, (np.abs(pixels - side / 2 + 0.5) < side / 2).all(axis=0)].astype(int)
    found = np.zeros((side, side), bool)
    found[row, column] = True
    return found
