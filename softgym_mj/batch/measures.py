"""Measures that the C++ library or a CUDA kernel computes, most for batches of tensors."""

import ctypes
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.library import open_library

MOST_MATCHED = 64  # Largest matrix; the same number as in matched.h.

_WARP = 32  # Threads of a warp.


def covered_areas(points: Any, triangles: Any, lines: int) -> Any:
    """Returns the covered areas (number,) [m^2] of meshes, as `metrics.covered_area`.

    Args:
        points: Vertices (number, vertices, 2 or 3) [m], float64.
        triangles: Vertex indices (number, triangles, 3), int64.
        lines: Number of scan lines.
    """
    points, triangles = points.contiguous(), triangles.contiguous()
    number, *sizes = points.shape
    lengths = points.new_empty((number, lines))
    areas = points.new_empty((number,))
    threads = min(-(-lines // _WARP) * _WARP, 8 * _WARP)
    numbers = [*sizes, triangles.shape[1], lines]
    arrays = [points, triangles, lengths, areas]
    _run("covered_areas", "CoveredAreas", number, threads, numbers, arrays)
    return areas


def covered_parts(
    points: np.ndarray, triangles: np.ndarray, lines: int, bottom: float, pitch: float
) -> np.ndarray:
    """Returns the lengths (n,) [m] that intersections of lines and triangles add to a cover.

    They are sorted by line and from left to right.

    Args:
        points: Vertices (vertices, 2 or 3) [m].
        triangles: Vertex indices (triangles, 3).
        lines: Number of scan lines: line i lies at Y = bottom + (i + 1/2) pitch.
        bottom: Least Y [m].
        pitch: Distance between lines [m].
    """
    points, triangles = np.ascontiguousarray(points, float), np.ascontiguousarray(triangles, int)
    parts = np.empty(lines * len(triangles))
    long, real, pointer = ctypes.c_longlong, ctypes.c_double, ctypes.c_void_p
    function = open_library().softgym_mj_covered_parts
    function.restype = long
    sizes = long(points.shape[1]), long(len(triangles)), long(lines)
    arrays = (pointer(array.ctypes.data) for array in (points, triangles, parts))
    return parts[: function(*sizes, real(bottom), real(pitch), *arrays)]


def matched_distances(distances: Any) -> Any:
    """Returns the smallest mean distances (number,) of one-to-one matchings.

    Args:
        distances: Distances (number, n, n), float64.

    Raises:
        InvalidArgumentError: If n exceeds `MOST_MATCHED`.
    """
    if distances.shape[-1] > MOST_MATCHED:
        valid = f"at most {MOST_MATCHED} of each, of tensors"
        raise InvalidArgumentError("number of points", distances.shape[-1], valid)
    distances = distances.contiguous()
    means = distances.new_empty(distances.shape[:1])
    number, count, _ = distances.shape
    _run("matched_distances", "MatchedDistances", number, _WARP, [count], [distances, means])
    return means


def _run(name: str, entry: str, number: int, threads: int, sizes: list[int], arrays: list) -> None:
    pointers = [array.data_ptr() for array in arrays]
    device = arrays[0].device
    if device.type == "cuda":
        from softgym_mj.batch import gpu

        gpu.launch("measures", entry, device, number, threads, *sizes, *pointers)
        return
    function = getattr(open_library(), f"softgym_mj_{name}")
    long, pointer = ctypes.c_longlong, ctypes.c_void_p
    function(long(number), *map(long, sizes), *map(pointer, pointers))
