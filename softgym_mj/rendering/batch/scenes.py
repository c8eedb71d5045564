"""`describe`: converts a compiled model to a scene of the batch renderer."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, cpu_only
from softgym_mj.rendering.batch.deformables import add_deformable
from softgym_mj.rendering.batch.layout import ARRAYS, EYE, LIGHT, SCENE, TEXTURE
from softgym_mj.rendering.batch.materials import depth_of, levels_of, sky_of
from softgym_mj.rendering.batch.rigid import add_rigids
from softgym_mj.rendering.batch.solids import marks_of, on_mover, solids_of
from softgym_mj.rendering.look import FAST, look_of
from softgym_mj.rendering.offscreen import camera_ids

_DIRECTIONAL = int(mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
_ALIGNMENT = 32  # [bytes] Alignment of arrays in a scene.


class Described(NamedTuple):
    """A scene and its textures, which many scenes share.

    Attributes:
        scene: Bytes (n,) uint8; `Pictures.load` sets the addresses of textures.
        texels: Texels of all textures and their mipmaps (m,) uint8.
    """

    scene: np.ndarray
    texels: np.ndarray


def describe(
    model: mujoco.MjModel,
    cameras: Sequence[str],
    movers: Mapping[int, int],
    parts: Mapping[str, Sequence[str]],
    marks: bool = False,
) -> Described:
    """Converts a model to a scene without poses.

    Args:
        model: Model with at most one sheet, rope or water.
        cameras: Camera names as in `camera_ids`.
        movers: Mover index by body; geoms of these bodies move with them.
        parts: As in `LabeledView`.
        marks: Whether goal marks are rendered, as panes; for colors only.

    Raises:
        InvalidArgumentError: If the batch renderer does not support something in the model.
    """
    if look_of(model) is not FAST:
        raise cpu_only(f"look={look_of(model).name!r}, with images,")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    scene, arrays = np.zeros((), SCENE), {}
    textures: list[np.ndarray] = []
    arrays["solids"], opaque, glasses = solids_of(model, data, movers, parts, textures)
    if marks:
        glasses += marks_of(model, data)
    rigid_faces = add_rigids(scene, arrays, opaque, glasses)
    add_deformable(scene, arrays, model, textures)
    arrays["triangles"] = np.concatenate(
        [arrays["triangles"], rigid_faces + int(scene["num_vertices"])]
    ).astype("i4")
    arrays["lights"] = _lights(model, data)
    arrays["eyes"] = _eyes(model, data, cameras, movers)
    arrays["sky"] = sky_of(model)
    headlight = model.vis.headlight
    scene["ambient"], scene["headlight"] = headlight.ambient, headlight.diffuse
    levels = [levels_of(texture) for texture in textures]
    arrays["textures"] = np.array(
        [(sum(map(len, levels[:i])), texture.shape[1], texture.shape[0], depth_of(texture), 0)
         for i, texture in enumerate(textures)], TEXTURE,
    )  # fmt: skip
    for name in ("solids", "lights", "eyes"):
        scene[f"num_{name}"] = len(arrays[name])
    packed, size = [], SCENE.itemsize
    for name in ARRAYS:
        padding = -size % _ALIGNMENT
        scene[name] = size + padding
        array = np.ascontiguousarray(arrays.get(name, np.zeros(0, "i4")))
        packed += [b"\0" * padding, array.tobytes()]
        size += padding + array.nbytes
    whole = np.frombuffer(scene.tobytes() + b"".join(packed), np.uint8)
    return Described(whole.copy(), np.concatenate([np.zeros(0, np.uint8), *levels]))


def textures_of(scene: np.ndarray) -> np.ndarray:
    """Returns a view (n,) of a scene's textures; their offsets are relative to `texels`."""
    head = scene[: SCENE.itemsize].view(SCENE)[0]
    first, count = int(head["textures"]), int(head["sky"] - head["textures"]) // TEXTURE.itemsize
    return scene[first : first + count * TEXTURE.itemsize].view(TEXTURE)


def _lights(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    rows = []
    for i in range(model.nlight):
        if model.light_type[i] != _DIRECTIONAL:
            raise InvalidArgumentError("light", model.light(i).name, "directional lights")
        towards, shadow = -data.light_xdir[i], int(model.light_castshadow[i])
        colors = model.light_diffuse[i], model.light_ambient[i], model.light_specular[i]
        rows.append((towards, *colors, shadow))
    return np.array(rows, LIGHT)


def _eyes(
    model: mujoco.MjModel, data: mujoco.MjData, cameras: Sequence[str], movers: Mapping[int, int]
) -> np.ndarray:
    rows, ids = [], camera_ids(model)
    for name in cameras:
        i = ids[name]
        pose = data.cam_xpos[i], data.cam_xmat[i].reshape(3, 3)
        mover, (position, rotation) = on_mover(model, data, movers, model.cam_bodyid[i], pose)
        slope = np.tan(np.radians(model.cam_fovy[i]) / 2.0)
        rows.append((mover, position, rotation, slope))
    return np.array(rows, EYE)
