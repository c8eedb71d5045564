"""Skins: rendered meshes whose vertices are weighted means of simulated points."""

import struct
from collections.abc import Callable

import numpy as np
from dm_control import mjcf
from scipy import sparse

DRAWN_SKINS = 5  # Group of skins that only our cameras show: other viewers do not update them.
SHOWN_FLEXES = 1  # Group of flexes that only other viewers show, in place of those skins.
HIDDEN_FLEXES = 4  # Group of flexes that no viewer shows.
NAME_BYTES = 40  # [bytes] Length of a body's name in a skin file.


class SkinFile(mjcf.Asset):
    """A skin in MuJoCo's binary format; names of bodies are resolved when it is read.

    Numbers in MJCF would take ten times as long to write and read.
    """

    __slots__ = ("_bodies", "_mesh", "_weights")

    def __init__(
        self,
        vertices: np.ndarray,
        texcoords: np.ndarray,
        faces: np.ndarray,
        weights: sparse.sparray | np.ndarray,
        places: np.ndarray,
        bodies: Callable[[], list[str]],
    ):
        """Stores a skin.

        Args:
            vertices: Positions (n, 3) [m].
            texcoords: Texture coordinates (n, 2), with (0, 0) at the upper left of the texture.
            faces: Vertex indices (m, 3), counterclockwise from outside.
            weights: Weights (n, b) of bodies for each vertex; rows sum to 1.
            places: Positions (b, 3) [m] of the bodies in the reference pose.
            bodies: Returns their names (b) in the complete model.
        """
        sizes = len(vertices), len(texcoords), len(faces), len(places)
        self._mesh = struct.pack("<4i", *sizes) + b"".join(
            np.ascontiguousarray(part, kind).tobytes()
            for part, kind in ((vertices, "<f4"), (texcoords, "<f4"), (faces, "<i4"))
        )
        columns = sparse.csc_array(weights)
        used, values = columns.indices.astype("<i4"), columns.data.astype("<f4")
        self._weights = [
            struct.pack("<7fi", *place, 1.0, 0.0, 0.0, 0.0, last - first)
            + used[first:last].tobytes()
            + values[first:last].tobytes()
            for place, first, last in zip(
                places, columns.indptr[:-1], columns.indptr[1:], strict=True
            )
        ]
        self._bodies = bodies
        mjcf.attribute.BaseAsset.__init__(self, ".skn")

    @property
    def contents(self) -> bytes:
        """Returns the content of the file."""
        parts = [self._mesh]
        for name, bone in zip(self._bodies(), self._weights, strict=True):
            encoded = name.encode()
            if len(encoded) >= NAME_BYTES:
                raise ValueError(f"body name {name!r} is too long for a skin")
            parts += [encoded.ljust(NAME_BYTES, b"\0"), bone]
        return b"".join(parts)


def loose_triangles(number: int) -> SkinFile:
    """Returns a static skin of separate triangles at the origin."""
    vertices = np.zeros((3 * number, 3))
    faces = np.arange(3 * number).reshape(-1, 3)
    return still(vertices, np.zeros((0, 2)), faces)


def still(vertices: np.ndarray, texcoords: np.ndarray, faces: np.ndarray) -> SkinFile:
    """Returns a static skin; the arguments are those of `SkinFile`."""
    weights = np.ones((len(vertices), 1))
    return SkinFile(vertices, texcoords, faces, weights, np.zeros((1, 3)), lambda: ["world"])


def spline(number: int, places: np.ndarray) -> np.ndarray:
    """Returns weights (m, number) of points in a cubic B-spline at `places` in 0..number - 1.

    The spline begins at the first point and ends at the last: points beyond are mirror images
    through these. No weight is negative, and a straight, evenly spaced row is reproduced exactly.
    """
    first = np.minimum(places.astype(int), number - 2)
    t = (places - first)[:, None]
    basis = np.hstack(
        [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
    )
    weights = np.zeros((len(places), number + 2))
    rows = np.arange(len(places))[:, None]
    weights[rows, first[:, None] + np.arange(4)] = basis / 6.0
    for end, step in ((0, 1), (-1, -1)):
        outside = weights[:, end].copy()
        weights[:, end + step] += 2.0 * outside
        weights[:, end + 2 * step] -= outside
    return weights[:, 1:-1]


def closed(faces: np.ndarray, number: int) -> np.ndarray:
    """Returns the faces (m, 3) of a thin solid: front, back and a strip around the rims.

    Args:
        faces: Faces (n, 3) of the front; vertices of the back have indices `number` higher.
        number: Number of vertices of the sheet.
    """
    sides = np.concatenate([faces, np.roll(faces, -1, 1), np.roll(faces, -2, 1)])[:, :2]
    key = np.sort(sides, axis=1) @ [number, 1]
    _, index, counts = np.unique(key, return_index=True, return_counts=True)
    a, b = sides[index[counts == 1]].T
    strip = [[b, a, a + number], [b, a + number, b + number]]
    return np.concatenate(
        [faces, faces[:, ::-1] + number, *(np.stack(part, axis=1) for part in strip)]
    )


def refined(number: int, triangles: np.ndarray) -> tuple[sparse.csr_array, np.ndarray]:
    """Makes one step of Loop subdivision of a mesh with rims.

    Args:
        number: Number of vertices.
        triangles: Vertex indices (k, 3).

    Returns:
        Weights (m, n) of the old vertices in the new ones, and new triangles (4 k, 3).
    """
    sides = np.sort(
        np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1
    )
    edges, which, counts = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    middle = which.reshape(-1, 3)  # Edges of a triangle: those after its corners.
    # Vertices: rims are splines of their own, except where they meet; Warren's weights inside.
    rim = counts == 1
    valence, rims = (np.bincount(part.ravel(), minlength=number) for part in (edges, edges[rim]))
    beta = np.where(valence == 3, 3 / 16, 3 / (8 * np.maximum(valence, 1)))
    own = np.where(rims == 0, 1 - valence * beta, np.where(rims == 2, 0.75, 1.0))
    ends = np.concatenate([edges, edges[:, ::-1]])
    on_spline = (rims[ends[:, 0]] == 2) & np.tile(rim, 2)
    shares = np.where(rims[ends[:, 0]] == 0, beta[ends[:, 0]], np.where(on_spline, 0.125, 0.0))
    # Edges: 3/8 of the ends and 1/8 of the two opposite corners, or the middle of a rim.
    rows = number + np.arange(len(edges))
    opposite = np.roll(triangles, -2, axis=1)
    parts = [
        (own, np.arange(number), np.arange(number)),
        (shares, *ends.T),
        *((np.where(rim, 0.5, 0.375), rows, edges[:, end]) for end in range(2)),
        (np.where(rim, 0.0, 0.125)[middle].ravel(), number + middle.ravel(), opposite.ravel()),
    ]
    values, places, sources = (np.concatenate(part) for part in zip(*parts, strict=True))
    shape = number + len(edges), number
    weights = sparse.csr_array(sparse.coo_array((values, (places, sources)), shape))
    weights.eliminate_zeros()
    (p, q, r), (x, y, z) = triangles.T, (number + middle).T
    faces = [[p, x, z], [x, q, y], [z, y, r], [x, y, z]]
    return weights, np.concatenate([np.stack(face, axis=1) for face in faces])
