"""Samples of a mesh's surface, and visibility of points from a camera.

The distance of a real cloud from vertices is at least about half their spacing, which depends on
the mesh rather than on the simulation; the distance from a sampled surface has no such limit.
"""

import dataclasses

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_number
from softgym_mj.rendering.calibration import Calibration

SPACING = 0.005  # [m] About the noise of depth cameras at a meter.
# [m] Least depth difference of an occluder: above rounding errors of a point's own triangles, far
# below the distance of two layers.
CLEARANCE = 1e-5
_ROUNDING = 1e-9  # Tolerance of the number of parts.
_CELL = 8  # [pixels] Size of the grid cells that match points and triangles.
_CHUNK = 4096  # Triangles at a time: their pairs with points fit into some ten megabytes.


@dataclasses.dataclass(frozen=True)
class SurfaceSamples:
    """Points of a mesh in barycentric coordinates, which move with its vertices.

    Attributes:
        corners: (n, 3) vertices of each point's triangle.
        weights: (n, 3) barycentric coordinates; their sum is 1.
    """

    corners: np.ndarray
    weights: np.ndarray

    def points(self, vertices: np.ndarray) -> np.ndarray:
        """Returns positions (n, 3) [m] for vertices (m, 3) [m]."""
        return np.einsum("nk,nkx->nx", self.weights, np.asarray(vertices, float)[self.corners])


def sample_surface(
    vertices: np.ndarray, triangles: np.ndarray, spacing: float = SPACING
) -> SurfaceSamples:
    """Samples a lattice on each triangle whose neighbors are at most `spacing` apart.

    It contains vertices and points of edges and of the interior, each once. An edge of length l has
    ceil(l / spacing) parts, the interior of a triangle the lattice of its longest edge. No point of
    the surface is farther than `spacing` from a sample.

    Args:
        vertices: (n, 3) [m].
        triangles: (m, 3) vertex indices, at least one.
        spacing: [m].

    Raises:
        InvalidArgumentError: for invalid shapes, indices or spacing.
    """
    vertices, triangles = _mesh(vertices, triangles)
    check_number("spacing", spacing, gt=0.0)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    edges, which = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    parts = np.maximum(np.ceil(lengths / spacing - _ROUNDING).astype(int), 1)
    finest = parts[which.reshape(-1, 3)].max(axis=1)
    used = np.unique(triangles)
    corners = [np.repeat(used[:, None], 3, axis=1)]
    weights = [np.tile([1.0, 0.0, 0.0], (len(used), 1))]
    for count in np.unique(parts):
        chosen = edges[parts == count]
        along = np.arange(1, count) / count
        places = np.column_stack([1.0 - along, along, np.zeros(count - 1)])
        _add(corners, weights, np.column_stack([chosen, chosen[:, 0]]), places)
    for count in np.unique(finest):
        i, j = np.meshgrid(np.arange(1, count), np.arange(1, count), indexing="ij")
        inside = i + j < count
        places = np.column_stack([i[inside], j[inside], count - i[inside] - j[inside]]) / count
        _add(corners, weights, triangles[finest == count], places)
    return SurfaceSamples(np.concatenate(corners), np.concatenate(weights))


def seen(
    points: np.ndarray,
    vertices: np.ndarray,
    triangles: np.ndarray,
    calibration: Calibration,
    size: tuple[int, int],
) -> np.ndarray:
    """Returns which of points (k, 3) [m] are visible to a camera: (k,) bool.

    A point is visible if it is in the image and no triangle in front of it is nearer to the camera
    by more than `CLEARANCE` in depth. The test is made at the point itself, not at pixels, so it
    does not depend on the resolution.

    Args:
        points: vertices or samples of the surface, or any others.
        vertices, triangles: (n, 3) [m] and (m, 3) of occluders.
        calibration: calibration of the camera.
        size: (height, width) of its images [pixels].

    Raises:
        InvalidArgumentError: for invalid shapes or indices, or a triangle that reaches behind the
            camera.
    """
    vertices, triangles = _mesh(vertices, triangles)
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidArgumentError("points", points.shape, "a shape (k, 3)")
    places, depths = calibration.project(vertices)
    if depths[triangles].min() <= 0.0:
        raise InvalidArgumentError("vertices", float(depths.min()), "in front of the camera")
    with np.errstate(divide="ignore", invalid="ignore"):  # Points in the camera's plane.
        spots, far = calibration.project(points)
    height, width = size
    in_image = (far > 0.0) & np.all(
        (spots >= -0.5) & (spots <= [width - 0.5, height - 0.5]), axis=1
    )
    visible = np.zeros(len(points), bool)
    candidates = np.flatnonzero(in_image)
    hidden = np.zeros(len(candidates), bool)
    spots, far = spots[candidates], far[candidates]
    for start in range(0, len(triangles), _CHUNK):
        some = triangles[start : start + _CHUNK]
        triangle, point = _near(places[some], spots, size)
        nearer = _depths(places[some][triangle], depths[some][triangle], spots[point])
        hidden[point[nearer < far[point] - CLEARANCE]] = True
    visible[candidates] = ~hidden
    return visible


def _add(corners: list, weights: list, owners: np.ndarray, places: np.ndarray) -> None:
    """Appends points with barycentric coordinates (k, 3) in each of owners (n, 3)."""
    corners.append(np.repeat(owners, len(places), axis=0))
    weights.append(np.tile(places, (len(owners), 1)))


def _near(
    shapes: np.ndarray, spots: np.ndarray, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Returns pairs of triangles (n, 3, 2) and spots (k, 2) that share cells: (p,) twice."""
    rows, columns = (side // _CELL + 1 for side in size)
    last = np.array([columns - 1, rows - 1])
    cell = np.clip(np.floor((spots + 0.5) / _CELL).astype(int), 0, last)
    number = cell[:, 1] * columns + cell[:, 0]
    order = np.argsort(number, kind="stable")
    counts = np.bincount(number, minlength=rows * columns)
    firsts = np.cumsum(counts) - counts
    low = np.floor((shapes.min(axis=1) + 0.5) / _CELL).astype(int)
    high = np.floor((shapes.max(axis=1) + 0.5) / _CELL).astype(int)
    outside = np.any((high < 0) | (low > last), axis=1)
    low, high = np.clip(low, 0, last), np.clip(high, 0, last)
    spans = np.where(outside[:, None], 0, high - low + 1)
    triangle, k = _expanded(spans[:, 0] * spans[:, 1])
    across = low[triangle, 0] + k % spans[triangle, 0]
    down = low[triangle, 1] + k // spans[triangle, 0]
    meeting = down * columns + across
    pair, k = _expanded(counts[meeting])
    return triangle[pair], order[firsts[meeting[pair]] + k]


def _expanded(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns each index repeated by its count, and the number of each repetition: (sum,) twice."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]


def _depths(shapes: np.ndarray, depths: np.ndarray, spots: np.ndarray) -> np.ndarray:
    """Returns depths (p,) [m] of triangles (p, 3, 2), (p, 3) deep, at spots (p, 2); else infinity.

    The reciprocal of depth is linear in the image.
    """
    away = shapes - spots[:, None]
    following = np.roll(away, -1, axis=1)
    opposite = away[..., 0] * following[..., 1] - away[..., 1] * following[..., 0]
    area = opposite.sum(axis=1)
    inside = np.all(opposite * np.sign(area)[:, None] >= 0.0, axis=1) & (area != 0.0)
    area = np.where(inside, area, 1.0)
    weights = np.roll(opposite, -1, axis=1) / area[:, None]  # Edge opposite to each corner.
    reciprocal = np.where(inside, np.sum(weights / depths, axis=1), 1.0)
    return np.where(inside, 1.0 / reciprocal, np.inf)


def _mesh(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns a mesh after validation."""
    vertices, triangles = np.asarray(vertices, float), np.asarray(triangles)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise InvalidArgumentError("vertices", vertices.shape, "finite, of a shape (n, 3)")
    whole = np.issubdtype(triangles.dtype, np.integer)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0 or not whole:
        raise InvalidArgumentError("triangles", triangles.shape, "indices of a shape (m, 3), m > 0")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        valid = f"indices of {len(vertices)} vertices"
        raise InvalidArgumentError("triangles", int(triangles.max()), valid)
    return vertices, triangles
