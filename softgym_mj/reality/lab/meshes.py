"""Strips along X with a rotated or unstructured mesh, to be clamped and hung."""

import numpy as np
import scipy.spatial

from softgym_mj.exceptions import check_name

# Meshes of a strip: grids by the angle [deg] between their lines and the strip.
MESHES = ("grid_0", "grid_45", "grid_90", "unstructured")


def strip(mesh: str, cells: int, width: int, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns vertices (n, 3) [m] and triangles (m, 3) of a flat strip along X, starting at x = 0.

    Args:
        mesh: one of `MESHES`.
        cells: approximate length in `spacing`.
        width: approximate width in `spacing`.
        spacing: vertex spacing [m].
    """
    check_name("mesh", mesh, MESHES)
    if mesh == "grid_45":
        diagonals = max(1, round(cells / np.sqrt(2.0))), max(1, round(width / np.sqrt(2.0)))
        places, triangles = bias(*diagonals)
    elif mesh == "unstructured":
        places, triangles = _unstructured(cells, width)
    else:
        places, triangles = _grid(cells, width)
        if mesh == "grid_90":  # The other lines of the same pattern are along the strip.
            places, triangles = _grid(width, cells)
            places, triangles = places[:, ::-1] * [1.0, 1.0], triangles[:, ::-1]
    places = places - [places[:, 0].min(), places[:, 1].mean()]
    return np.column_stack([spacing * places, np.zeros(len(places))]), triangles


def _square(i: int, j: int) -> list[list[tuple[int, int]]]:
    """Returns the two triangles of a cell; diagonals alternate, as in `Cloth`."""
    a, b, c, d = (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
    return [[a, b, d], [a, d, c]] if (i + j) % 2 == 0 else [[a, b, c], [b, d, c]]


def _numbered(nodes: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """Returns nodes (n, 2) and the triangles (m, 3) of all cells between them."""
    number = {node: n for n, node in enumerate(nodes)}
    cells = sorted({cell for i, j in nodes for cell in ((i, j), (i - 1, j), (i, j - 1))})
    corners = [triangle for i, j in cells for triangle in _square(i, j)]
    found = [[number[c] for c in t] for t in corners if all(c in number for c in t)]
    return np.array(nodes, float), np.array(found)


def _grid(cells: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    return _numbered([(i, j) for i in range(cells + 1) for j in range(width + 1)])


def bias(length: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns a grid cut at 45 degrees along diagonals of cells of even parity.

    These are nodes (n, 2), in spacings, and triangles (m, 3) of a strip of `length` by `width`
    diagonals.
    """
    size = length + width
    nodes = [
        (i, j)
        for i in range(size + 1)
        for j in range(-width, size + 1)
        if 0 <= i + j <= 2 * length and 0 <= i - j <= 2 * width
    ]
    places, triangles = _numbered(nodes)
    turned = np.column_stack([places.sum(axis=1), places[:, 1] - places[:, 0]]) / np.sqrt(2.0)
    return turned, triangles


_SHARE = 0.3  # Irregularity of inner vertices relative to the spacing.
_SEED = 0


def _unstructured(cells: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns a Delaunay triangulation of irregular vertices, regular at the clamp and the end."""
    x, y = np.meshgrid(np.arange(cells + 1.0), np.arange(width + 1.0), indexing="ij")
    moves = np.random.default_rng(_SEED).uniform(-_SHARE, _SHARE, (*x.shape, 2))
    moves[:3, :, 0] = moves[-1, :, 0] = 0.0
    moves[:, [0, -1], 1] = 0.0
    points = (np.stack([x, y], axis=-1) + moves).reshape(-1, 2)
    triangles = scipy.spatial.Delaunay(points).simplices
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(area[:, None] < 0.0, triangles[:, ::-1], triangles)
    return points, triangles[np.abs(area) > 1e-6]
