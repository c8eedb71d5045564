"""Measures of many simulations at once, of PyTorch's tensors on any device, by the library."""

import ctypes
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.library import open_library

MOST_MATCHED = 64  # As in matched.h.

_WARP = 32  # Threads.


def covered_areas(points: Any, triangles: Any, lines: int) -> Any:
    """`metrics.covered_area` of meshes, as float64 (number,) [m^2].

    Args:
        points: (number, vertices, 2 or 3) [m] float64.
        triangles: (number, triangles, 3) int64 vertices.
        lines: number of lines.
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


def matched_distances(distances: Any) -> Any:
    """Smallest means (number,) of one of each row and column of distances (number, n, n) float64.

    Raises:
        InvalidArgumentError: for more than `MOST_MATCHED` rows.
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
