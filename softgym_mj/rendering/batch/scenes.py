"""`describe`: what pictures have to know of a compiled model."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.meshes import tube_faces
from softgym_mj.rendering.look import FAST, look_of
from softgym_mj.rendering.observables import geom_labels
from softgym_mj.rendering.offscreen import camera_ids
from softgym_mj.rendering.skins import DRAWN_SKINS
from softgym_mj.rendering.surfaces import PARTICLES, ROPE_FLEX, ROPE_SKIN, WATER_SKIN, rope_shape
from softgym_mj.rendering.textures import texture_of

# As in scene.h.
_SKY_ROWS, _MOST_SOLIDS = 32, 32
_NOTHING, _SHEET, _ROPE, _WATER = range(4)
_BOX, _SPHERE, _CYLINDER, _MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in ("BOX", "SPHERE", "CYLINDER", "MESH")
)
_SHAPES = (_BOX, _SPHERE, _CYLINDER)
_MATERIAL = [("color", "f4", 3), ("opacity", "f4"), ("specular", "f4"), ("shininess", "f4"),
             ("texture", "i4"), ("repeat", "f4")]  # fmt: skip
_SOLID = np.dtype(
    [("shape", "i4"), ("mover", "i4"), ("label", "i4"), ("size", "f4", 3), ("position", "f4", 3),
     ("rotation", "f4", (3, 3)), ("material", _MATERIAL)]
)  # fmt: skip
_GLASS = np.dtype(
    [("mover", "i4"), ("first_vertex", "i4"), ("num_vertices", "i4"), ("first_triangle", "i4"),
     ("num_triangles", "i4"), ("material", _MATERIAL)]
)  # fmt: skip
_LIGHT = np.dtype(
    [("direction", "f4", 3), ("diffuse", "f4", 3), ("ambient", "f4", 3), ("specular", "f4", 3),
     ("has_shadow", "i4")]
)  # fmt: skip
_EYE = np.dtype([("position", "f4", 3), ("rotation", "f4", (3, 3)), ("slope", "f4")])
_TEXTURE = np.dtype(
    [("texels", "u8"), ("width", "i4"), ("height", "i4"), ("levels", "i4"), ("unused", "i4")]
)
_ARRAYS = (
    "glasses", "solids", "lights", "eyes", "textures", "sky", "weight_starts", "weight_points",
    "weights", "around_starts", "around", "triangles", "texcoords", "glass_places",
    "glass_normals", "circle", "quarter",
)  # fmt: skip
_SCENE = np.dtype(
    [
        *((name, "i4") for name in (
            "kind", "num_points", "num_vertices", "num_triangles", "num_glasses", "glass_vertices",
            "glass_triangles", "num_solids", "num_lights", "num_eyes", "num_movers", "sides",
            "rings_per_edge", "most_triangles",
        )),
        *((name, "f4") for name in ("inflate", "radius", "spacing", "voxel")),
        ("ambient", "f4", 3), ("headlight", "f4", 3), ("material", _MATERIAL),
        *((name, "i4") for name in _ARRAYS),
    ]
)  # fmt: skip
_DIRECTIONAL = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
_ALIGNMENT = 32  # [bytes] Of arrays in a scene.
_SHOWN = 3  # Groups of geoms that are drawn are below.


class Described(NamedTuple):
    """A scene, with its textures apart: many scenes have the same.

    Attributes:
        scene: bytes (n,) uint8; `Pictures.load` fills in where textures are.
        texels: of all textures with their smaller levels, (m,) uint8.
    """

    scene: np.ndarray
    texels: np.ndarray


def describe(
    model: mujoco.MjModel,
    cameras: Sequence[str],
    movers: Mapping[int, int],
    parts: Mapping[str, Sequence[str]],
) -> Described:
    """What pictures of a model show, all but where things are.

    Args:
        model: with at most one sheet, rope or water.
        cameras: names, as in `camera_ids`.
        movers: numbers by body: what these bodies carry is drawn where they are.
        parts: as of `LabelledView`.

    Raises:
        InvalidArgumentError: for what cannot be drawn so.
    """
    if look_of(model) is not FAST:
        raise InvalidArgumentError("look", look_of(model).name, f"{FAST.name!r}, on this device")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    scene, arrays = np.zeros((), _SCENE), {}
    textures: list[np.ndarray] = []
    arrays["solids"], glasses = _solids(model, data, movers, parts, textures)
    _add_glasses(scene, arrays, glasses)
    _add_deformable(scene, arrays, model, textures)
    arrays["triangles"] = np.concatenate(
        [arrays["triangles"], arrays.pop("glass_faces") + int(scene["num_vertices"])]
    ).astype("i4")
    arrays["lights"] = _lights(model, data)
    arrays["eyes"] = _eyes(model, data, cameras)
    arrays["sky"] = _sky(model)
    headlight = model.vis.headlight
    scene["ambient"], scene["headlight"] = headlight.ambient, headlight.diffuse
    levels = [_levels(texture) for texture in textures]
    arrays["textures"] = np.array(
        [(sum(map(len, levels[:i])), texture.shape[1], texture.shape[0], _depth(texture), 0)
         for i, texture in enumerate(textures)], _TEXTURE,
    )  # fmt: skip
    for name in ("solids", "lights", "eyes"):
        scene[f"num_{name}"] = len(arrays[name])
    scene["num_movers"] = len(set(movers.values()))
    packed, size = [], _SCENE.itemsize
    for name in _ARRAYS:
        padding = -size % _ALIGNMENT
        scene[name] = size + padding
        array = np.ascontiguousarray(arrays.get(name, np.zeros(0, "i4")))
        packed += [b"\0" * padding, array.tobytes()]
        size += padding + array.nbytes
    whole = np.frombuffer(scene.tobytes() + b"".join(packed), np.uint8)
    return Described(whole.copy(), np.concatenate([np.zeros(0, np.uint8), *levels]))


def textures_of(scene: np.ndarray) -> np.ndarray:
    """A view of the textures of a scene: where they are is said from the start of `texels`."""
    head = scene[: _SCENE.itemsize].view(_SCENE)[0]
    first, count = int(head["textures"]), int(head["sky"] - head["textures"]) // _TEXTURE.itemsize
    return scene[first : first + count * _TEXTURE.itemsize].view(_TEXTURE)


# ------------------------------------------------------------------ surfaces


def _material(
    model: mujoco.MjModel, number: int, rgba: np.ndarray, textures: list[np.ndarray]
) -> np.ndarray:
    """The material of something that has a number of one, or -1 and a colour."""
    found = np.zeros((), _MATERIAL)
    color = rgba if number < 0 else model.mat_rgba[number]
    found["color"], found["opacity"], found["texture"] = color[:3], color[3], -1
    if number >= 0:
        found["specular"], found["shininess"] = (
            model.mat_specular[number], model.mat_shininess[number],
        )  # fmt: skip
        texels = texture_of(model, number)
        if texels is not None:
            found["texture"], found["repeat"] = len(textures), model.mat_texrepeat[number, 0]
            textures.append(texels)
    return found


def _levels(texture: np.ndarray) -> np.ndarray:
    """A texture (height, width, 3) uint8 and its halves, down to one texel: bytes (n,)."""
    level, found = texture.astype(np.float32), []
    for _ in range(_depth(texture)):
        opaque = np.full((*level.shape[:2], 4), 255, np.uint8)
        opaque[..., :3] = np.round(level)
        found.append(opaque.ravel())
        height, width = (max(side // 2, 1) for side in level.shape[:2])
        steps = level.shape[0] // height, level.shape[1] // width
        cut = level[: height * steps[0], : width * steps[1]]
        level = cut.reshape(height, steps[0], width, steps[1], 3).mean(axis=(1, 3))
    return np.concatenate(found)


def _depth(texture: np.ndarray) -> int:
    return int(np.log2(max(texture.shape[:2]))) + 1


def _sky(model: mujoco.MjModel) -> np.ndarray:
    """Colours (rows, 3) of the sky by the sine of the elevation, from -1 to 1."""
    boxes = np.flatnonzero(model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX))
    if not len(boxes):
        return np.zeros((_SKY_ROWS, 3), "f4")
    number = boxes[0]
    size, channels, first = (
        int(model.tex_width[number]), int(model.tex_nchannel[number]), model.tex_adr[number],
    )  # fmt: skip
    faces = model.tex_data[first : first + 6 * size * size * channels]
    faces = faces.reshape(6, size, size, channels)[..., :3] / 255.0
    found = []
    for sine in np.linspace(-1.0, 1.0, _SKY_ROWS):
        flat = np.sqrt(max(1.0 - sine**2, 0.0))
        if abs(sine) <= flat:  # On the front, in the middle.
            row = (0.5 - 0.5 * sine / flat) * (size - 1)
            found.append(faces[4, round(row), size // 2])
        else:
            column = (0.5 + 0.5 * flat / abs(sine)) * (size - 1)
            found.append(faces[2 if sine > 0.0 else 3, size // 2, round(column)])
    return np.array(found, "f4")


# ------------------------------------------------------------------ solids and glass


def _solids(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    movers: Mapping[int, int],
    parts: Mapping[str, Sequence[str]],
    textures: list[np.ndarray],
) -> tuple[np.ndarray, list]:
    """Solids, and of glass: number of the mover, places, normals, triangles and material."""
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
        material = _material(model, model.geom_matid[geom], model.geom_rgba[geom], textures)
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
    return np.array([_flat(solid) for solid in solids], _SOLID), glasses


def _flat(values: tuple) -> tuple:
    return tuple(v.item() if isinstance(v, np.ndarray) and not v.ndim else v for v in values)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and normals (n, 3), and triangles (m, 3), of a mesh."""
    faces = _part(model.mesh_face, model.mesh_faceadr, model.mesh_facenum, mesh)
    of_normals = _part(model.mesh_facenormal, model.mesh_faceadr, model.mesh_facenum, mesh)
    places = _part(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    normals = _part(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum, mesh)
    pairs, which = np.unique(
        np.stack([faces.ravel(), of_normals.ravel()], axis=1), axis=0, return_inverse=True
    )
    return places[pairs[:, 0]], normals[pairs[:, 1]], which.reshape(-1, 3)


def _part(array: np.ndarray, first: np.ndarray, number: np.ndarray, i: int) -> np.ndarray:
    return array[first[i] : first[i] + number[i]]


def _add_glasses(scene: np.ndarray, arrays: dict[str, np.ndarray], glasses: list) -> None:
    rows, vertices, triangles = [], 0, 0
    for mover, places, _, faces, material in glasses:
        row = (mover, vertices, len(places), triangles, len(faces), material)
        rows.append(_flat(row))
        vertices, triangles = vertices + len(places), triangles + len(faces)
    arrays["glasses"] = np.array(rows, _GLASS)
    empty = np.zeros((0, 3), "f4")
    arrays["glass_places"] = np.concatenate([empty, *(g[1] for g in glasses)]).astype("f4")
    arrays["glass_normals"] = np.concatenate([empty, *(g[2] for g in glasses)]).astype("f4")
    faces = [g[3] + row[1] for g, row in zip(glasses, rows, strict=True)]
    arrays["glass_faces"] = np.concatenate([np.zeros((0, 3), "i4"), *faces])
    scene["num_glasses"], scene["glass_vertices"] = len(glasses), vertices
    scene["glass_triangles"] = triangles


# ------------------------------------------------------------------ what deforms


def _add_deformable(
    scene: np.ndarray,
    arrays: dict[str, np.ndarray],
    model: mujoco.MjModel,
    textures: list[np.ndarray],
) -> None:
    arrays["triangles"] = np.zeros((0, 3), "i4")
    if not model.nskin:
        return
    if model.nskin > 1:
        raise InvalidArgumentError("objects", model.nskin, "one rope, cloth or water")
    prefix, slash, name = model.skin(0).name.rpartition("/")
    prefix += slash
    material = _material(model, model.skin_matid[0], model.skin_rgba[0], textures)
    scene["material"] = material.item()
    drawn = model.skin_group[0] == DRAWN_SKINS
    if drawn and name == WATER_SKIN:
        number, spacing = model.numeric(prefix + PARTICLES).data.tolist()
        scene["kind"], scene["num_points"], scene["spacing"] = _WATER, int(number), spacing
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
    scene["kind"], scene["num_points"], scene["radius"] = _ROPE, number, model.flex_radius[flex]
    scene["sides"], scene["rings_per_edge"] = sides, rings
    faces, _ = tube_faces(number, sides=sides, rings_per_edge=rings)
    assert len(faces) == scene["num_triangles"], "as the skin was made"
    caps = max(sides // 4, 2)
    for name, angles in {
        "circle": 2.0 * np.pi * np.arange(sides) / sides,
        "quarter": 0.5 * np.pi * np.arange(caps + 1) / caps,
    }.items():
        arrays[name] = np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _add_sheet(scene: np.ndarray, arrays: dict[str, np.ndarray], model: mujoco.MjModel) -> None:
    """See `entities.sheet`: bones are vertices of the flex, which only shift."""
    (flex,) = range(model.nflex)
    point_of = {
        int(body): i
        for i, body in enumerate(
            _part(model.flex_vertbodyid, model.flex_vertadr, model.flex_vertnum, flex)
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
    arrays["weight_starts"] = _starts(joined, count)
    arrays["weight_points"] = np.concatenate(points)[order].astype("i4")
    arrays["weights"] = np.concatenate(weights)[order].astype("f4")
    corners = arrays["triangles"].ravel()
    arrays["around_starts"] = _starts(corners, count)
    arrays["around"] = (np.argsort(corners, kind="stable") // 3).astype("i4")
    scene["kind"], scene["num_points"], scene["inflate"] = (
        _SHEET, len(point_of), model.skin_inflate[0],
    )  # fmt: skip


def _starts(numbers: np.ndarray, count: int) -> np.ndarray:
    """Where each of 0..count begins among sorted numbers: (count + 1,)."""
    return np.searchsorted(np.sort(numbers), np.arange(count + 1)).astype("i4")


# ------------------------------------------------------------------ lights and cameras


def _lights(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    rows = []
    for i in range(model.nlight):
        if model.light_type[i] != _DIRECTIONAL:
            raise InvalidArgumentError("light", model.light(i).name, "directional ones")
        towards, shadow = -data.light_xdir[i], int(model.light_castshadow[i])
        rows.append(
            (
                towards,
                model.light_diffuse[i],
                model.light_ambient[i],
                model.light_specular[i],
                shadow,
            )
        )
    return np.array(rows, _LIGHT)


def _eyes(model: mujoco.MjModel, data: mujoco.MjData, cameras: Sequence[str]) -> np.ndarray:
    rows, ids = [], camera_ids(model)
    for name in cameras:
        i = ids[name]
        slope = np.tan(np.radians(model.cam_fovy[i]) / 2.0)
        rows.append((data.cam_xpos[i], data.cam_xmat[i].reshape(3, 3), slope))
    return np.array(rows, _EYE)
