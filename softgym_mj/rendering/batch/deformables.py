"""The deformable object of a scene: a sheet, a rope or water."""

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.meshes import cap_rings, tube_faces
from softgym_mj.rendering.batch.layout import ROPE, SHEET, WATER
from softgym_mj.rendering.batch.materials import material_of
from softgym_mj.rendering.batch.ragged import part_of, starts_of
from softgym_mj.rendering.look import FAST
from softgym_mj.rendering.skins import DRAWN_SKINS
from softgym_mj.rendering.surfaces import PARTICLES, ROPE_FLEX, ROPE_SKIN, WATER_SKIN, rope_shape


def add_deformable(
    scene: np.ndarray,
    arrays: dict[str, np.ndarray],
    model: mujoco.MjModel,
    textures: list[np.ndarray],
) -> None:
    """Adds the deformable object to a scene.

    Args:
        scene: Struct of the scene.
        arrays: Arrays by name in `layout.ARRAYS`.
        model: Model to render.
        textures: Textures of all materials so far.

    Raises:
        InvalidArgumentError: If there is more than one.
    """
    arrays["triangles"] = np.zeros((0, 3), "i4")
    if not model.nskin:
        return
    if model.nskin > 1:
        raise InvalidArgumentError("objects", model.nskin, "one rope, cloth or water")
    prefix, slash, name = model.skin(0).name.rpartition("/")
    prefix += slash
    material = material_of(model, model.skin_matid[0], model.skin_rgba[0], textures)
    scene["material"] = material.item()
    drawn = model.skin_group[0] == DRAWN_SKINS
    if drawn and name == WATER_SKIN:
        number, spacing = model.numeric(prefix + PARTICLES).data.tolist()
        scene["kind"], scene["num_points"], scene["spacing"] = WATER, int(number), spacing
        scene["voxel"], scene["most_triangles"] = FAST.water_cell * spacing, FAST.water_triangles
        return
    scene["num_vertices"], scene["num_triangles"] = model.skin_vertnum[0], model.skin_facenum[0]
    arrays["triangles"] = model.skin_face[: model.skin_facenum[0]].astype("i4")
    arrays["texcoords"] = model.skin_texcoord[: model.skin_vertnum[0]].astype("f4")
    if drawn and name == ROPE_SKIN:
        flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, prefix + ROPE_FLEX)
        _add_rope(scene, arrays, model, flex)
    else:
        _add_sheet(scene, arrays, model)


def _add_rope(
    scene: np.ndarray, arrays: dict[str, np.ndarray], model: mujoco.MjModel, flex: int
) -> None:
    shape = rope_shape(FAST)
    sides, rings = shape["sides"], shape["rings_per_edge"]
    number = int(model.flex_vertnum[flex])
    scene["kind"], scene["num_points"], scene["radius"] = ROPE, number, model.flex_radius[flex]
    scene["sides"], scene["rings_per_edge"] = sides, rings
    faces, _ = tube_faces(number, sides=sides, rings_per_edge=rings)
    assert len(faces) == scene["num_triangles"], "as the skin was made"
    caps = cap_rings(sides)
    for name, angles in {
        "circle": 2.0 * np.pi * np.arange(sides) / sides,
        "quarter": 0.5 * np.pi * np.arange(caps + 1) / caps,
    }.items():
        arrays[name] = np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _add_sheet(scene: np.ndarray, arrays: dict[str, np.ndarray], model: mujoco.MjModel) -> None:
    """Adds a sheet, a skin whose bones are the flex's vertices and only translate."""
    (flex,) = range(model.nflex)
    point_of = {
        int(body): i
        for i, body in enumerate(
            part_of(model.flex_vertbodyid, model.flex_vertadr, model.flex_vertnum, flex)
        )
    }
    points, vertices, weights = [], [], []
    for bone in range(int(model.skin_bonenum[0])):
        first, number = model.skin_bonevertadr[bone], model.skin_bonevertnum[bone]
        own = model.skin_bonevertid[first : first + number]
        vertices.append(own)
        weights.append(model.skin_bonevertweight[first : first + number])
        points.append(np.full(len(own), point_of[int(model.skin_bonebodyid[bone])]))
    count = int(scene["num_vertices"])
    joined = np.concatenate(vertices)
    order = np.argsort(joined, kind="stable")
    arrays["weight_starts"] = starts_of(joined, count)
    arrays["weight_points"] = np.concatenate(points)[order].astype("i4")
    arrays["weights"] = np.concatenate(weights)[order].astype("f4")
    corners = arrays["triangles"].ravel()
    arrays["around_starts"] = starts_of(corners, count)
    arrays["around"] = (np.argsort(corners, kind="stable") // 3).astype("i4")
    scene["kind"], scene["num_points"], scene["inflate"] = (
        SHEET, len(point_of), model.skin_inflate[0],
    )  # fmt: skip
