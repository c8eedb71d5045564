"""Rigid objects and glass of a scene."""

import itertools
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.batch.layout import GLASS, SOLID
from softgym_mj.rendering.batch.materials import material_of
from softgym_mj.rendering.batch.ragged import part_of
from softgym_mj.rendering.observables import geom_labels
from softgym_mj.rendering.offscreen import SHOWN_SITES

_BOX, _SPHERE, _CYLINDER, _MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in ("BOX", "SPHERE", "CYLINDER", "MESH")
)
_SHAPES = (_BOX, _SPHERE, _CYLINDER)  # The same order as in scene.h.
_MOST_SOLIDS = 32  # Number of bits in a visibility mask.
_SHOWN = 3  # Groups of geoms below this number are rendered.


def solids_of(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    movers: Mapping[int, int],
    parts: Mapping[str, Sequence[str]],
    textures: list[np.ndarray],
) -> tuple[np.ndarray, list]:
    """Returns solids, and mover, vertices, normals, triangles and material of each glass geom.

    Raises:
        InvalidArgumentError: If there are other shapes or too many solids.
    """
    labels, solids, glasses = geom_labels(model, parts), [], []
    for geom in np.flatnonzero(model.geom_group < _SHOWN):
        body = int(model.geom_bodyid[geom])
        while body and body not in movers:
            body = int(model.body_parentid[body])
        mover = movers.get(body, -1)
        position, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        if mover >= 0:
            turn = data.xmat[body].reshape(3, 3)
            position, rotation = turn.T @ (position - data.xpos[body]), turn.T @ rotation
        material = material_of(model, model.geom_matid[geom], model.geom_rgba[geom], textures)
        kind = int(model.geom_type[geom])
        if kind == _MESH and material["opacity"] < 1.0:
            places, normals, faces = _mesh(model, model.geom_dataid[geom])
            glasses.append(
                (mover, places @ rotation.T + position, normals @ rotation.T, faces, material)
            )
        elif kind in _SHAPES:
            shape = _SHAPES.index(kind)
            solids.append(
                (shape, mover, labels[geom], model.geom_size[geom], position, rotation, material)
            )
        else:
            name = mujoco.mjtGeom(kind).name
            raise InvalidArgumentError(
                "geom", f"{model.geom(geom).name}, {name}", "boxes, spheres, cylinders and glass"
            )
    if len(solids) > _MOST_SOLIDS:
        raise InvalidArgumentError("geoms", len(solids), f"at most {_MOST_SOLIDS} to draw")
    return np.array([_flat(solid) for solid in solids], SOLID), glasses


def marks_of(model: mujoco.MjModel, data: mujoco.MjData) -> list:
    """Returns visible sites as panes, in the format of glass of `solids_of`.

    Raises:
        InvalidArgumentError: If a site is not a box.
    """
    found = []
    for site in np.flatnonzero(model.site_group < SHOWN_SITES):
        kind = int(model.site_type[site])
        if kind != _BOX:
            raise InvalidArgumentError("site", mujoco.mjtGeom(kind).name, "boxes")
        rotation = data.site_xmat[site].reshape(3, 3)
        places = _BOX_CORNERS * model.site_size[site] @ rotation.T + data.site_xpos[site]
        material = material_of(model, model.site_matid[site], model.site_rgba[site], [])
        found.append((-1, places, _BOX_NORMALS @ rotation.T, _BOX_FACES, material))
    return found


def _box() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns corners and normals (24, 3) and triangles (12, 3) of a box with half sizes 1."""
    corners, normals = [], []
    for axis, sign in itertools.product(range(3), (-1.0, 1.0)):
        normal, first = sign * np.eye(3)[axis], np.eye(3)[axis - 2]
        second = np.cross(normal, first)  # Corners go round counterclockwise, seen from outside.
        corners += [
            normal + a * first + b * second for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        normals += [normal] * 4
    faces = [4 * side + np.array(face) for side in range(6) for face in ((0, 1, 2), (0, 2, 3))]
    return np.array(corners), np.array(normals), np.array(faces)


_BOX_CORNERS, _BOX_NORMALS, _BOX_FACES = _box()


def _flat(values: tuple) -> tuple:
    return tuple(v.item() if isinstance(v, np.ndarray) and not v.ndim else v for v in values)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns vertices and normals (n, 3) and triangles (m, 3) of a mesh."""
    faces = part_of(model.mesh_face, model.mesh_faceadr, model.mesh_facenum, mesh)
    of_normals = part_of(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum, mesh)
    places = part_of(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    normals = part_of(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum, mesh)
    pairs, which = np.unique(
        np.stack([faces.ravel(), of_normals.ravel()], axis=1), axis=0, return_inverse=True
    )
    return places[pairs[:, 0]], normals[pairs[:, 1]], which.reshape(-1, 3)


def add_glasses(scene: np.ndarray, arrays: dict[str, np.ndarray], glasses: list) -> np.ndarray:
    """Adds glass from `solids_of` to a scene; returns its triangles (n, 3)."""
    rows, vertices, triangles = [], 0, 0
    for mover, places, _, faces, material in glasses:
        row = (mover, vertices, len(places), triangles, len(faces), material)
        rows.append(_flat(row))
        vertices, triangles = vertices + len(places), triangles + len(faces)
    arrays["glasses"] = np.array(rows, GLASS)
    empty = np.zeros((0, 3), "f4")
    arrays["glass_places"] = np.concatenate([empty, *(g[1] for g in glasses)]).astype("f4")
    arrays["glass_normals"] = np.concatenate([empty, *(g[2] for g in glasses)]).astype("f4")
    scene["num_glasses"], scene["glass_vertices"] = len(glasses), vertices
    scene["glass_triangles"] = triangles
    faces = [g[3] + row[1] for g, row in zip(glasses, rows, strict=True)]
    return np.concatenate([np.zeros((0, 3), "i4"), *faces])
