"""Reads the mesh of a sheet from a file and repairs what the solver cannot simulate."""

import os
import pathlib
import warnings

import numpy as np
from scipy import sparse, spatial

from softgym_mj.exceptions import InvalidArgumentError, check_number
from softgym_mj.validation import typed

SUFFIXES = (".obj", ".off", ".ply", ".stl")
# [m] Closer vertices are merged: cloth passes through lower triangles.
JOINED = 1e-4
# [m] Longest side of a garment's bounding box. Smaller ones are below two thicknesses; a king-size
# sheet has 2.8 m.
SMALLEST, LARGEST = 0.02, 5.0
MOST_VERTICES = 5000  # With 5000 a step takes 0.2 s, and memory grows with their square.
UNITS = {"millimeters": 0.001, "centimeters": 0.01}
_USUAL = (0.3, 2.0)  # [m] Longest side of clothes, from which units are guessed.
# Lowest triangles and longest edges in thicknesses without a warning. Layers rest closer at lower
# triangles (the solver's kMaxThickness); longer edges make folds coarse. Cloths' have 2 to 4.
LOWEST_TRIANGLE, LONGEST_EDGE = 1.0 / 0.9, 6.0


@typed
def read_mesh(file: str | os.PathLike, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Returns the vertices (n, 3) [m] and triangles (m, 3) of a mesh file, repaired.

    trimesh reads the file. Polygons become triangles, all objects of the file become one mesh,
    vertices less than 0.1 mm apart are merged, and unused vertices are removed. Triangles that
    collapse in this way and duplicate triangles are removed, with a warning that counts them.

    Args:
        file: an OBJ, OFF, PLY or STL file.
        scale: meters per unit of the file.

    Raises:
        InvalidArgumentError: if there is no such file, it has no triangles or a number that is not
            finite, or it is smaller than 2 cm or larger than 5 m or has more than 5000 vertices;
            for a bad scale.
    """
    check_number("scale", scale, gt=0.0)
    path = pathlib.Path(file).resolve()
    points, triangles = _load(path)
    # STL files and MuJoCo have float32 numbers.
    points = points.astype(np.float32).astype(np.float64) * scale
    used = points[np.unique(triangles)]
    if not np.isfinite(used).all():
        raise InvalidArgumentError("file", str(path), "a mesh of finite numbers")
    _check_size(path, np.ptp(used, axis=0).max(), scale)
    points, triangles, dropped = _joined(points, triangles)
    if not len(triangles):
        raise InvalidArgumentError("file", str(path), "a mesh with a triangle of area above 0")
    if len(points) > MOST_VERTICES:
        raise InvalidArgumentError(
            f"{path.name} has {len(points)} vertices; expected at most {MOST_VERTICES}: simplify "
            "it, for example with MeshLab or trimesh's `simplify_quadric_decimation`."
        )
    if dropped:
        warnings.warn(
            f"{path.name}: dropped {dropped} of {dropped + len(triangles)} triangles: zero area "
            "or duplicates",
            stacklevel=2,
        )
    return points, triangles


def _load(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file() or path.suffix.lower() not in SUFFIXES:
        raise InvalidArgumentError("file", str(path), f"a file that exists: {', '.join(SUFFIXES)}")
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # Incomplete textures cause warnings.
            # trimesh merges nothing: `_joined` keeps the order of vertices.
            mesh = trimesh.load_mesh(path, process=False, maintain_order=True, skip_materials=True)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise InvalidArgumentError(f"trimesh cannot read file={str(path)!r}: {error}") from error
    if not len(mesh.faces) or mesh.vertices.shape[1] != 3:
        raise InvalidArgumentError("file", str(path), "a mesh with triangles")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _check_size(path: pathlib.Path, size: float, scale: float) -> None:
    if SMALLEST <= size <= LARGEST:
        return
    low, high = _USUAL
    found = {unit: factor for unit, factor in UNITS.items() if low <= factor * size <= high}
    guess = " or ".join(f"{unit}: pass scale={scale * f:g}" for unit, f in found.items())
    raise InvalidArgumentError(
        f"{path.name} measures {size:.4g} m with scale={scale:g}; expected {SMALLEST} to {LARGEST} "
        "m. " + (f"It looks like {guess}." if guess else "Pass its unit in meters as `scale`.")
    )


def _joined(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Returns points and triangles after merging, and the number of removed triangles."""
    count = len(points)
    # Duplicates are merged first: a place with thousands of vertices has millions of pairs.
    _, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
    pairs = spatial.cKDTree(points[first]).query_pairs(JOINED, output_type="ndarray")
    links = np.concatenate(
        [np.column_stack([np.arange(count), first[place.ravel()]]), first[pairs]]
    )
    graph = sparse.coo_array((np.ones(len(links)), links.T), (count, count))
    _, group = sparse.csgraph.connected_components(graph, directed=False)
    _, least, index = np.unique(group, return_index=True, return_inverse=True)
    triangles = least[index][triangles]  # Each vertex is the first of its group.
    a, b, c = triangles.T
    whole = triangles[(a != b) & (b != c) & (c != a)]
    _, kept = np.unique(np.sort(whole, axis=1), axis=0, return_index=True)
    whole = whole[np.sort(kept)]
    used = np.unique(whole)
    return points[used], np.searchsorted(used, whole), len(triangles) - len(whole)


def triangle_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Returns areas (m,) [m^2] of triangles (m, 3) of points (n, 3) [m]."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(normals, axis=1) / 2.0


def mesh_warnings(points: np.ndarray, triangles: np.ndarray, thickness: float) -> list[str]:
    """Returns warnings about a mesh as a sheet of a thickness [m], each a sentence."""
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2))
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    corners = points[triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    doubled = 2.0 * triangle_areas(points, triangles)
    low, high = LOWEST_TRIANGLE * thickness, LONGEST_EDGE * thickness
    slim, flat = (np.count_nonzero(doubled < height * sides) for height in (low, JOINED))
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), (len(points),) * 2)
    parts, part = sparse.csgraph.connected_components(graph, directed=False)
    found = []
    if slim:
        found.append(
            f"{slim} of {len(triangles)} triangles are lower than {low:.2g} m, 1.1 times the "
            "thickness: layers rest closer there"
        )
    if flat:
        found.append(
            f"{flat} triangles are lower than {JOINED} m and may pass through those beside them"
        )
    if lengths.max() > high:
        found.append(
            f"edges are up to {lengths.max():.2g} m long: folds are coarse where they are longer "
            f"than {high:.2g} m, 6 times the thickness"
        )
    if counts.max() > 2:
        found.append(
            f"{np.count_nonzero(counts > 2)} edges belong to more than 2 triangles, of which two "
            "resist bending"
        )
    if parts > 1:
        sizes = np.sort(np.bincount(part))[::-1]
        found.append(
            f"{parts} parts are not connected, of {', '.join(map(str, sizes[:4]))}"
            f"{', ...' if parts > 4 else ''} vertices: all are kept and move apart"
        )
    return found
