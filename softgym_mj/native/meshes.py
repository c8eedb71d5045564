"""Triangle meshes of ropes and water for rendering.

The native library makes them: vertices and normals are float32 arrays, as required by
`mujoco.MjvScene.skinvert`. They do not affect the simulation.
"""

import ctypes
import functools
import math
from typing import NamedTuple

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.native.library import open_library

MOST_TRIANGLES = 2_000_000  # Limit of a surface: 250 times those of a cup of water.
LEAST_TRIANGLES = 400  # Smallest limit of a water surface: enough for any particles.
_MOST_POINTS, _MOST_SIDES, _MOST_RINGS = 100_000, 256, 64
_FARTHEST = 1e30  # [m] The square of larger numbers overflows in single precision.


class Mesh(NamedTuple):
    """Closed triangle mesh.

    Attributes:
        vertices: Positions (v, 3) [m], float32.
        normals: Outward unit normals (v, 3), float32.
        faces: Vertex indices (f, 3), counterclockwise seen from outside, int32.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


class Strands(NamedTuple):
    """Strands of a laid rope.

    Attributes:
        lobes: Number of strands; 0 makes a plain tube.
        depth: Depth of the valleys between them relative to the radius.
        twist: Rotation along the rope [rad/m].
    """

    lobes: int
    depth: float
    twist: float


PLAIN = Strands(0, 0.0, 0.0)
ROPE = Strands(3, 0.22, 70.0)  # One turn in 9 cm: the lay of a 12 mm hawser-laid rope.


@functools.cache
def _library() -> ctypes.CDLL:
    library = open_library()
    pointer, whole, real = ctypes.c_void_p, ctypes.c_int, ctypes.c_double
    library.softgym_mj_tube.argtypes = [
        pointer, whole, real, whole, whole, whole, whole, real, real, pointer, pointer,
    ]  # fmt: skip
    library.softgym_mj_water_mesh.argtypes = [
        pointer, whole, real, real, whole, real, pointer, pointer, pointer, pointer,
    ]  # fmt: skip
    return library


def _points(argument: str, value: np.ndarray, least: int, most: int) -> np.ndarray:
    """Returns `value` as a contiguous float64 array (n, 3)."""
    try:
        points = np.ascontiguousarray(value, np.float64)
    except (TypeError, ValueError):
        raise InvalidArgumentError(argument, value, "an array of numbers (n, 3)") from None
    if points.ndim != 2 or points.shape[1] != 3 or not least <= len(points) <= most:
        shape = f"an array of shape {points.shape}"
        raise InvalidArgumentError(argument, shape, f"shape (n, 3), n in {least}..{most}")
    return points


def _check_number(argument: str, value: float, low: float, high: float = math.inf) -> None:
    if not isinstance(value, int | float | np.number) or not low <= value <= min(high, _FARTHEST):
        raise InvalidArgumentError(argument, value, f"a number in {low:g}..{high:g}")


def cap_rings(sides: int) -> int:
    """Returns the number of rings of a rounded end of a `tube`."""
    return max(2, sides // 4)


def tube(
    points: np.ndarray, radius: float, *, sides: int, rings_per_edge: int, strands: Strands = PLAIN
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the surface of a rope: a tube along a smooth curve through points, with round ends.

    The tube consists of rings of `sides + 1` vertices: the last vertex of a ring coincides with its
    first one, with another texture coordinate. `tube_faces` connects them.

    Args:
        points: Two or more points (n, 3) [m]; they may coincide.
        radius: Radius [m], the largest one if there are strands.
        sides: Vertices around the tube, 3 or more.
        rings_per_edge: Rings from a point to the next.
        strands: Strands of the rope.

    Returns:
        Vertices (v, 3) [m] and unit normals (v, 3), float32.

    Raises:
        InvalidArgumentError: If the points have another shape or are not finite, or a number is out
            of range.
        MemoryError: If there is not enough memory.
    """
    points = _points("points", points, 2, _MOST_POINTS)
    if not (np.abs(points) < _FARTHEST).all():
        raise InvalidArgumentError("points", points, "finite numbers")
    _check_number("radius", radius, 1e-9)
    _check_number("strands.depth", strands.depth, 0.0, 1.0)
    _check_number("strands.twist", strands.twist, -1e6, 1e6)
    lobes = check_count("strands.lobes", strands.lobes, 0, _MOST_SIDES)
    shape = (_rings(len(points), sides, rings_per_edge) * (sides + 1), 3)
    vertices, normals = np.empty(shape, np.float32), np.empty(shape, np.float32)
    failed = _library().softgym_mj_tube(
        points.ctypes.data, len(points), radius, sides, rings_per_edge, cap_rings(sides), lobes,
        strands.depth, strands.twist, vertices.ctypes.data, normals.ctypes.data,
    )  # fmt: skip
    if failed:
        raise MemoryError
    return vertices, normals


def _rings(n: int, sides: int, rings_per_edge: int) -> int:
    check_count("sides", sides, 3, _MOST_SIDES)
    check_count("rings_per_edge", rings_per_edge, 1, _MOST_RINGS)
    return (n - 1) * rings_per_edge + 1 + 2 * cap_rings(sides)


def tube_faces(n: int, *, sides: int, rings_per_edge: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns faces and texture coordinates of a `tube` along n points.

    Returns:
        Faces (f, 3), int32, and texture coordinates (v, 2), float32: the first one around the
        rope, the second one from its start to its end, both in 0..1.

    Raises:
        InvalidArgumentError: If a number is out of range.
    """
    check_count("n", n, 2, _MOST_POINTS)
    rings, caps = _rings(n, sides, rings_per_edge), cap_rings(sides)
    first = np.arange(rings * (sides + 1), dtype=np.int32).reshape(rings, sides + 1)
    a, b, c, d = first[:-1, :-1], first[:-1, 1:], first[1:, 1:], first[1:, :-1]
    # The outermost rings are points: only one triangle of their quads has an area.
    lower, upper = np.stack([a, b, c], -1)[1:], np.stack([a, c, d], -1)[:-1]
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])
    along = np.clip((np.arange(rings) - caps) / (rings - 1 - 2 * caps), 0.0, 1.0)
    around = np.linspace(0.0, 1.0, sides + 1)
    texture = np.stack(np.meshgrid(around, along), axis=-1).reshape(-1, 2)
    return faces, texture.astype(np.float32)


def water_mesh(
    positions: np.ndarray,
    spacing: float,
    voxel: float,
    *,
    offset: float = 0.0,
    most_triangles: int = MOST_TRIANGLES,
) -> Mesh:
    """Returns the surface of water.

    Args:
        positions: Particle positions (n, 3) [m]; particles that are not finite or a million voxels
            away are left out.
        spacing: Rest distance of particles [m].
        voxel: Approximate vertex distance [m], spacing/8 to 8 spacings. If there are too many
            triangles, it grows by factors of 1.4; each time drops (particles with fewer than 4
            neighbors) grow as well and every second one is left out, which preserves their area.
        offset: Outward displacement of the surface [m]; negative values detach it from walls.
        most_triangles: Largest number of triangles; `LEAST_TRIANGLES` always suffice.

    Returns:
        The closed surface; `mesh.vertices[mesh.faces]` are separate triangles (f, 3, 3).

    Raises:
        InvalidArgumentError: If the array has another shape, a number is out of range, or
            `most_triangles` do not suffice.
        MemoryError: If there is not enough memory.
    """
    positions = _points("positions", positions, 0, _MOST_POINTS * 10)
    _check_number("spacing", spacing, 1e-6)
    _check_number("voxel", voxel, spacing / 8, 8 * spacing)
    _check_number("offset", offset, -spacing, spacing)
    most = check_count("most_triangles", most_triangles, 1, MOST_TRIANGLES)
    vertices, normals = np.empty((2, most, 3), np.float32)
    faces, sizes = np.empty((most, 3), np.int32), np.zeros(2, np.int32)
    failed = _library().softgym_mj_water_mesh(
        positions.ctypes.data, len(positions), spacing, voxel, most, offset,
        vertices.ctypes.data, normals.ctypes.data, faces.ctypes.data, sizes.ctypes.data,
    )  # fmt: skip
    if failed == 1:
        raise InvalidArgumentError(
            "most_triangles", most_triangles, f"more for these {len(positions)} particles"
        )
    if failed:
        raise MemoryError
    v, f = sizes
    return Mesh(vertices[:v].copy(), normals[:v].copy(), faces[:f].copy())
