"""Rigid triangle meshes of a scene: meshes of geoms, and boxes and round shapes as meshes."""

import itertools
import math
from typing import NamedTuple

import mujoco
import numpy as np

from softgym_mj.rendering.batch.layout import RIGID
from softgym_mj.rendering.batch.ragged import part_of

_BOX, _SPHERE, _CYLINDER, _CAPSULE, _MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "MESH")
)
_POLE = 1e-9  # [m] Largest radius of a pole, whose triangles have two corners there.
SIDES = 20  # Sides of a round shape: at a radius of 5 cm the error is at most 0.6 mm.


class Mesh(NamedTuple):
    """Triangle mesh.

    Attributes:
        places, normals: Vertices [m] and their normals (n, 3).
        faces: Vertices of triangles (m, 3), counterclockwise from outside.
    """

    places: np.ndarray
    normals: np.ndarray
    faces: np.ndarray

    def moved(self, rotation: np.ndarray, position: np.ndarray) -> "Mesh":
        """Returns the mesh, rotated by a matrix (3, 3) and moved by `position` (3,) [m]."""
        return Mesh(self.places @ rotation.T + position, self.normals @ rotation.T, self.faces)


class Rigid(NamedTuple):
    """Mesh on a mover, or fixed with mover -1, its label and material."""

    mover: int
    label: int
    mesh: Mesh
    material: np.ndarray


def mesh_of(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Returns the surface of a geom in its frame; None for a shape without one."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _MESH:
        return _stored(model, model.geom_dataid[geom])
    if kind == _BOX:
        return box(size)
    if kind == _CYLINDER:
        radius, half = size[:2]
        ends = [(0.0, -half), (radius, -half)], [(radius, half), (0.0, half)]
        down, up = [(0.0, -1.0)] * 2, [(0.0, 1.0)] * 2
        side = [(radius, -half), (radius, half)]
        return _turned([*ends[0], *side, *ends[1]], [*down, *[(1.0, 0.0)] * 2, *up])
    if kind in (_SPHERE, _CAPSULE):
        quarter = np.linspace(0.0, math.pi / 2, SIDES // 4 + 1)
        angles = np.concatenate([-quarter[::-1], quarter])
        normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        profile, half = size[0] * normals, size[1] if kind == _CAPSULE else 0.0
        profile[:, 1] += np.repeat([-half, half], len(quarter))
        return _turned(profile, normals)
    return None


def _turned(profile: object, normals: object) -> Mesh:
    """Returns the surface of a profile (n, 2) of radii and heights [m], turned about the z axis.

    The profile rises outside; points with zero radius are poles.
    """
    profile, normals = np.array(profile), np.array(normals)
    angles = np.arange(SIDES) * (2.0 * math.pi / SIDES)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)

    def around(points: np.ndarray) -> np.ndarray:
        flat = points[:, None, :1] * circle
        heights = np.broadcast_to(points[:, None, 1:], (*flat.shape[:2], 1))
        return np.concatenate([flat, heights], axis=2).reshape(-1, 3)

    faces = []
    for row, k in itertools.product(range(len(profile) - 1), range(SIDES)):
        if np.array_equal(profile[row], profile[row + 1]):
            continue
        a, b = row * SIDES + k, row * SIDES + (k + 1) % SIDES
        faces += [(a, b, b + SIDES)] if profile[row, 0] > _POLE else []
        faces += [(a, b + SIDES, a + SIDES)] if profile[row + 1, 0] > _POLE else []
    return Mesh(around(profile), around(normals), np.array(faces))


def box(size: np.ndarray) -> Mesh:
    """Returns a box with half sizes (3,) [m]."""
    return _BOXES._replace(places=_BOXES.places * size)


def _box() -> Mesh:
    """Returns a box with half sizes 1."""
    corners, normals = [], []
    for axis, sign in itertools.product(range(3), (-1.0, 1.0)):
        normal, first = sign * np.eye(3)[axis], np.eye(3)[axis - 2]
        second = np.cross(normal, first)  # Corners go round counterclockwise, seen from outside.
        corners += [
            normal + a * first + b * second for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        normals += [normal] * 4
    faces = [4 * side + np.array(face) for side in range(6) for face in ((0, 1, 2), (0, 2, 3))]
    return Mesh(np.array(corners), np.array(normals), np.array(faces))


_BOXES = _box()


def _stored(model: mujoco.MjModel, mesh: int) -> Mesh:
    """Returns a mesh of the model."""
    faces = part_of(model.mesh_face, model.mesh_faceadr, model.mesh_facenum, mesh)
    of_normals = part_of(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum, mesh)
    places = part_of(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    normals = part_of(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum, mesh)
    pairs, which = np.unique(
        np.stack([faces.ravel(), of_normals.ravel()], axis=1), axis=0, return_inverse=True
    )
    return Mesh(places[pairs[:, 0]], normals[pairs[:, 1]], which.reshape(-1, 3))


def flat(values: tuple) -> tuple:
    """Returns a row of a NumPy struct: arrays without dimensions become numbers and tuples."""
    return tuple(v.item() if isinstance(v, np.ndarray) and not v.ndim else v for v in values)


def add_rigids(
    scene: np.ndarray, arrays: dict[str, np.ndarray], parts: list[Rigid], glasses: list[Rigid]
) -> np.ndarray:
    """Adds opaque meshes and then those of glass to a scene; returns their triangles (n, 3)."""
    rows, vertices, triangles = [], 0, 0
    for name, rigids in (("part", parts), ("glass", glasses)):
        first_vertex, first_triangle = vertices, triangles
        for mover, label, mesh, material in rigids:
            sizes = len(mesh.places), len(mesh.faces)
            rows.append(flat((mover, label, vertices, sizes[0], triangles, sizes[1], material)))
            vertices, triangles = vertices + sizes[0], triangles + sizes[1]
        scene[f"{name}_vertices"] = vertices - first_vertex
        scene[f"{name}_triangles"] = triangles - first_triangle
    scene["num_parts"], scene["num_glasses"] = len(parts), len(glasses)
    meshes = [rigid.mesh for rigid in (*parts, *glasses)]
    arrays["rigids"], empty = np.array(rows, RIGID), np.zeros((0, 3), "f4")
    arrays["rigid_places"] = np.concatenate([empty, *(m.places for m in meshes)]).astype("f4")
    arrays["rigid_normals"] = np.concatenate([empty, *(m.normals for m in meshes)]).astype("f4")
    faces = [mesh.faces + row[2] for mesh, row in zip(meshes, rows, strict=True)]
    return np.concatenate([np.zeros((0, 3), "i4"), *faces])
