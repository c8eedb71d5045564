"""`Mesh`: vertices and triangles of a sheet at rest, and rectangles."""

import dataclasses
import functools
import math

import numpy as np

from softgym_mj.entities.cloth import alternating_triangles
from softgym_mj.exceptions import InvalidArgumentError, check_number


@dataclasses.dataclass(frozen=True)
class Mesh:
    """A sheet at rest.

    Attributes:
        points: (n, 3) vertices [m].
        triangles: (m, 3) vertex indices.
    """

    points: np.ndarray
    triangles: np.ndarray

    def __post_init__(self):
        points, triangles = np.asarray(self.points, float), np.asarray(self.triangles)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise InvalidArgumentError("points", points.shape, "finite, of a shape (n, 3)")
        whole = np.issubdtype(triangles.dtype, np.integer)
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0 or not whole:
            valid = "indices of a shape (m, 3), m > 0"
            raise InvalidArgumentError("triangles", triangles.shape, valid)
        if not np.array_equal(np.unique(triangles), np.arange(len(points))):
            valid = f"indices of all {len(points)} vertices, and of no others"
            raise InvalidArgumentError("triangles", triangles, valid)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "triangles", triangles)

    @functools.cached_property
    def edges(self) -> np.ndarray:
        """Vertex indices (e, 2), each edge once."""
        sides = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        return np.unique(sides.reshape(-1, 2), axis=0)

    @functools.cached_property
    def lengths(self) -> np.ndarray:
        """Rest lengths (e,) [m] of the edges."""
        return self.edge_lengths(self.points)

    @functools.cached_property
    def area(self) -> float:
        """Total area [m^2] at rest."""
        return float(self.triangle_areas.sum())

    @functools.cached_property
    def triangle_areas(self) -> np.ndarray:
        """Area (m,) [m^2] of each triangle at rest."""
        corners = self.points[self.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.linalg.norm(normals, axis=1) / 2.0

    @functools.cached_property
    def vertex_areas(self) -> np.ndarray:
        """Area (n,) [m^2] of each vertex: a third of the triangles around it."""
        shares = np.repeat(self.triangle_areas / 3.0, 3)
        return np.bincount(self.triangles.ravel(), shares, len(self.points))

    def edge_lengths(self, positions: np.ndarray) -> np.ndarray:
        """Returns lengths (e,) [m] of the edges for vertices at `positions` (n, 3) [m]."""
        first, second = positions[self.edges[:, 0]], positions[self.edges[:, 1]]
        return np.linalg.norm(first - second, axis=1)

    def strain(self, positions: np.ndarray) -> np.ndarray:
        """Returns relative elongations (e,) of the edges for vertices at `positions` (n, 3) [m]."""
        return self.edge_lengths(positions) / self.lengths - 1.0


def rectangle(width: float, depth: float, spacing: float) -> Mesh:
    """Returns a flat rectangle about the origin, at z = 0, of cells with alternating diagonals.

    Vertex 0 is the corner at -X and +Y; rows go along +X, row after row towards -Y. So vertex
    `columns - 1` is the corner at +X and +Y.

    Args:
        width, depth: along X and Y [m].
        spacing: approximate vertex spacing [m], rounded to whole cells.

    Raises:
        InvalidArgumentError: for sides or a spacing that make less than one cell.
    """
    sides = {"width": width, "depth": depth, "spacing": spacing}
    for name, value in sides.items():
        check_number(name, value, gt=0.0, lt=math.inf)
    columns, rows = (max(round(side / spacing), 1) + 1 for side in (width, depth))
    return grid(width, depth, rows, columns)


def grid(width: float, depth: float, rows: int, columns: int) -> Mesh:
    """Returns a `rectangle` with `rows` vertices along Y and `columns` along X, each 2 or more."""
    x, y = np.meshgrid(
        np.linspace(-width / 2, width / 2, columns), np.linspace(depth / 2, -depth / 2, rows)
    )
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return Mesh(points, alternating_triangles(rows, columns))
