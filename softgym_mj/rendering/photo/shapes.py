"""Triangle meshes of MuJoCo's shapes, with normals and texture coordinates."""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy import sparse

from softgym_mj.native.meshes import Mesh

SIDES = 96  # Corners of circles.
FARTHEST = 60.0  # [m] Half side of an infinite plane.
_GEOM = mujoco.mjtGeom


class Triangles(NamedTuple):
    """A triangle mesh.

    Attributes:
        vertices: Positions (v, 3) [m].
        normals: Unit normals (v, 3); None means flat faces.
        texcoords: Texture coordinates (v, 2), with (0, 0) at the upper left of a texture, or None.
        faces: Vertex indices (f, 3), counterclockwise from outside.
    """

    vertices: np.ndarray
    normals: np.ndarray | None
    texcoords: np.ndarray | None
    faces: np.ndarray


def shape(kind: int, size: np.ndarray) -> Triangles | None:
    """Returns the mesh of a shape in its own frame; None for lines, labels and the like.

    Args:
        kind: Value of `mujoco.mjtGeom`.
        size: Size (3,) [m] as in `mujoco.MjvGeom`.
    """
    if kind == _GEOM.mjGEOM_PLANE:
        x, y = np.where(size[:2] > 0.0, size[:2], FARTHEST)
        corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
        up = np.tile([0.0, 0.0, 1.0], (4, 1))
        return Triangles(corners, up, corners[:, :2], np.array([[0, 1, 2], [0, 2, 3]]))
    if kind == _GEOM.mjGEOM_BOX:
        return _box(size)
    if kind not in _PROFILES:
        return None
    points, slopes = _PROFILES[kind](size)
    return _revolved(points, slopes, size[:2] / size[0])


def _box(size: np.ndarray) -> Triangles:
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    vertices, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.insert(square, axis, sign, axis=1)
            # The order of axes reverses the orientation of Y's sides, and so does a negative sign.
            vertices.append(side if (sign > 0.0) == (axis != 1) else side[::-1])
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
    first = 4 * np.arange(6)[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    corners = np.concatenate(vertices) * size
    return Triangles(corners, np.concatenate(normals), corners[:, :2], faces)


def _arc(start: float, end: float) -> np.ndarray:
    """Returns radius and height (n, 2) of a unit arc between two elevations [rad]."""
    angles = np.linspace(start, end, SIDES // 4 + 1)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _sphere(size):
    arc = _arc(-np.pi / 2, np.pi / 2)
    return arc * size[[0, 2]], arc / size[[0, 2]]


def _capsule(size):
    lower, upper = _arc(-np.pi / 2, 0.0), _arc(0.0, np.pi / 2)
    points = np.concatenate([size[0] * lower - [0, size[2]], size[0] * upper + [0, size[2]]])
    return points, np.concatenate([lower, upper])


def _cylinder(size):
    radius, half = size[0], size[2]
    points = [[0, -half], [radius, -half], [radius, -half], [radius, half], [radius, half]]
    normals = [[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]]
    return np.array([*points, [0, half]]), np.array(normals, float)


# Profiles from bottom to top, radius and height [m], and their normals.
_PROFILES = {
    _GEOM.mjGEOM_SPHERE: _sphere,
    _GEOM.mjGEOM_ELLIPSOID: _sphere,
    _GEOM.mjGEOM_CAPSULE: _capsule,
    _GEOM.mjGEOM_CYLINDER: _cylinder,
}


def _revolved(points: np.ndarray, slopes: np.ndarray, widths: np.ndarray) -> Triangles:
    """Returns the surface of revolution about Z of a profile (n, 2) with normals (n, 2).

    It is scaled by `widths` (2,) along X and Y.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES + 1)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])

    def turned(profile: np.ndarray, scale: np.ndarray) -> np.ndarray:
        flat = profile[:, None, :1] * circle * scale
        height = np.broadcast_to(profile[:, None, 1:], (*flat.shape[:2], 1))
        return np.concatenate([flat, height], axis=2).reshape(-1, 3)

    vertices, normals = turned(points, widths), turned(slopes, 1.0 / widths)
    around, along = np.meshgrid(angles / (2.0 * np.pi), np.linspace(1.0, 0.0, len(points)))
    corner = np.arange(len(vertices)).reshape(len(points), -1)
    a, b, c, d = (
        part.ravel()
        for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Triangles(vertices, _unit(normals), np.dstack([around, along]).reshape(-1, 2), faces)


def mesh(model: mujoco.MjModel, number: int) -> Triangles:
    """Returns a mesh of a model with separate vertices for each triangle."""

    def part(values: np.ndarray, first: np.ndarray, count: np.ndarray) -> np.ndarray:
        return values[first[number] : first[number] + count[number]]

    faces, counts = model.mesh_faceadr, model.mesh_facenum
    corners = part(model.mesh_face, faces, counts).ravel()
    vertices = part(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum)[corners]
    across = part(model.mesh_facenormal, faces, counts).ravel()
    normals = part(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum)[across]
    texcoords = None
    if model.mesh_texcoordadr[number] >= 0:
        own = part(model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum)
        texcoords = own[part(model.mesh_facetexcoord, faces, counts).ravel()]
    return Triangles(vertices, normals, texcoords, np.arange(len(corners)).reshape(-1, 3))


def weighted(vertices: np.ndarray, faces: np.ndarray) -> Triangles:
    """Returns a surface with area-weighted vertex normals, so that large faces look flat.

    Vertices may be duplicated.
    """
    places, which = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    joined = which.reshape(-1)[faces]
    a, b, c = (places[corner] for corner in joined.T)
    normals = np.zeros_like(places)
    np.add.at(normals, joined.ravel(), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    return Triangles(places, _unit(normals), None, joined)


def smooth(surface: Mesh, passes: int) -> Triangles:
    """Smooths a closed surface by Taubin's filter."""
    ends = np.concatenate([surface.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    number = len(surface.vertices)
    near = sparse.coo_matrix((np.ones(len(ends)), ends.T), (number, number)).tocsr()
    near = sparse.diags(1.0 / np.maximum(near.sum(axis=1).A1, 1.0)) @ near
    vertices = surface.vertices.astype(float)
    for _ in range(passes):
        for step in (0.5, -0.53):  # The second step undoes the shrinkage of the first.
            vertices += step * (near @ vertices - vertices)
    return weighted(vertices, surface.faces)


def _unit(normals: np.ndarray) -> np.ndarray:
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
