"""Materials, textures and the sky of a scene."""

import mujoco
import numpy as np

from softgym_mj.rendering.batch.layout import MATERIAL
from softgym_mj.rendering.textures import texture_of

_SKY_ROWS = 32  # The same number as in scene.h.


def material_of(
    model: mujoco.MjModel, number: int, rgba: np.ndarray, textures: list[np.ndarray]
) -> np.ndarray:
    """Returns the `MATERIAL` (0-dimensional) of a material id, or of a color if the id is -1.

    It appends the material's texture, if any, to `textures`.
    """
    found = np.zeros((), MATERIAL)
    color = rgba if number < 0 else model.mat_rgba[number]
    found["color"], found["opacity"], found["texture"] = color[:3], color[3], -1
    if number >= 0:
        found["specular"] = model.mat_specular[number]
        found["shininess"] = model.mat_shininess[number]
        texels = texture_of(model, number)
        if texels is not None:
            found["texture"], found["repeat"] = len(textures), model.mat_texrepeat[number, 0]
            textures.append(texels)
    return found


def levels_of(texture: np.ndarray) -> np.ndarray:
    """Returns the mipmaps of a texture (height, width, 3) uint8 as bytes (n,)."""
    level, found = texture.astype(np.float32), []
    for _ in range(depth_of(texture)):
        opaque = np.full((*level.shape[:2], 4), 255, np.uint8)
        opaque[..., :3] = np.round(level)
        found.append(opaque.ravel())
        height, width = (max(side // 2, 1) for side in level.shape[:2])
        steps = level.shape[0] // height, level.shape[1] // width
        cut = level[: height * steps[0], : width * steps[1]]
        level = cut.reshape(height, steps[0], width, steps[1], 3).mean(axis=(1, 3))
    return np.concatenate(found)


def depth_of(texture: np.ndarray) -> int:
    """Returns the number of mipmap levels of a texture."""
    return int(np.log2(max(texture.shape[:2]))) + 1


def sky_of(model: mujoco.MjModel) -> np.ndarray:
    """Returns colors (rows, 3) of the sky by the sine of the elevation, from -1 to 1."""
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
        if abs(sine) <= flat:  # The middle of the front face.
            row = (0.5 - 0.5 * sine / flat) * (size - 1)
            found.append(faces[4, round(row), size // 2])
        else:
            column = (0.5 + 0.5 * flat / abs(sine)) * (size - 1)
            found.append(faces[2 if sine > 0.0 else 3, size // 2, round(column)])
    return np.array(found, "f4")
