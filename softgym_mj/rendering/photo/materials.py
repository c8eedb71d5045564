"""Materials as Mitsuba's BSDFs."""

import dataclasses
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from softgym_mj.rendering.textures import texture_of

Color = tuple[float, float, float]  # (r, g, b) in 0..1, in linear light.


@dataclasses.dataclass(frozen=True)
class Clear:
    """Transparent material.

    Attributes:
        index: Refractive index.
        tint: Color of light that passes one surface.
    """

    index: float
    tint: Color


@dataclasses.dataclass(frozen=True)
class Opaque:
    """Opaque material with attributes of Mitsuba's "principled" BSDF.

    Its color, and reflections that are None, are those of the model.
    """

    roughness: float | None = None
    specular: float | None = None
    metallic: float = 0.0
    sheen: float = 0.0
    clearcoat: float = 0.0


STEEL = Opaque(0.28, metallic=1.0)
# Finishes by the last part of a material's name in the model; all others are `Opaque()`.
FINISHES: dict[str, Clear | Opaque] = {
    "glass": Clear(1.5, (0.985, 0.995, 0.99)),
    "water": Clear(1.33, (0.70, 0.90, 0.98)),
    "fabric": Opaque(0.9, 0.2, sheen=0.6),
    "rope": Opaque(0.7, 0.3, sheen=0.3),
    "ball": Opaque(0.55, 0.4),
    "shell": Opaque(0.35, 0.5, clearcoat=0.3),
    "collar": STEEL,
    "shaft": STEEL,
    "metal": STEEL,
    "table": Opaque(0.8, 0.2),
    "room": Opaque(0.9, 0.1),
}


def finish_of(model: mujoco.MjModel, material: int) -> Clear | Opaque:
    """Returns the finish of a material id of a model; -1 means no material."""
    name = "" if material < 0 else model.material(material).name
    return FINISHES.get(name.rpartition("/")[2], Opaque())


def linear(values: npt.ArrayLike) -> np.ndarray:
    """Converts sRGB values (...) in 0..1 to linear light (...)."""
    values = np.asarray(values, float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


LIGHT = linear(np.arange(256) / 255.0)  # Linear light of each sRGB value uint8.


def pixels(light: np.ndarray) -> np.ndarray:
    """Converts linear light (...) to sRGB values (...) uint8; values above 1 are clipped."""
    light = np.clip(light, 0.0, 1.0)
    values = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255.0 * values).astype(np.uint8)


def bsdf(mi: Any, model: mujoco.MjModel, geom: mujoco.MjvGeom, has_texture: bool) -> Any:
    """Returns the BSDF of a geom of a scene; `mi` is Mitsuba."""
    finish = finish_of(model, geom.matid)
    if isinstance(finish, Clear):
        tint = {"type": "rgb", "value": list(finish.tint)}
        clear = {"type": "dielectric", "int_ior": finish.index, "specular_transmittance": tint}
        return mi.load_dict(clear)
    color = linear(geom.rgba[:3])
    picture = texture_of(model, geom.matid) if has_texture else None
    base: dict[str, Any] = {"type": "rgb", "value": color.tolist()}
    if picture is not None:
        light = (color * LIGHT[picture]).astype(np.float32)
        base = {"type": "bitmap", "bitmap": mi.Bitmap(light), "raw": True}
    own = dataclasses.asdict(finish)
    if finish.roughness is None:  # Shininess 1 is a mirror to MuJoCo.
        own["roughness"] = 1.0 - 0.8 * float(np.clip(geom.shininess, 0.0, 1.0))
    if finish.specular is None:
        own["specular"] = float(np.clip(geom.specular, 0.0, 1.0))
    opaque: dict[str, Any] = {
        "type": "twosided",
        "bsdf": {"type": "principled", "base_color": base, **own},
    }
    if geom.rgba[3] < 1.0:
        opaque = {"type": "mask", "opacity": float(geom.rgba[3]), "bsdf": opaque}
    return mi.load_dict(opaque)
