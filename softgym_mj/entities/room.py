"""A table in a room, and its lights: seen, and felt by nothing."""

import math

import numpy as np
from dm_control import mjcf

from softgym_mj.rendering import look as looks
from softgym_mj.rendering.look import Look, Surface
from softgym_mj.rendering.textures import plaster

# [m] Of the table: half its sides, its top's thickness, its height above the floor of the room.
HALF_SIDES, TOP, HEIGHT = (1.3, 1.1), 0.04, 0.75
SHEET = 0.002  # [m] Thickness of the laminate upon it.
LAMP_DISTANCE = 3.0  # [m] Of the lights from the middle of what happens.
_SEEN = {"contype": 0, "conaffinity": 0, "mass": 0.0}  # Of geoms.


def add_material(root: mjcf.RootElement, name: str, surface: Surface, **texture: object) -> None:
    """Adds a material to a model.

    Args:
        root: the model.
        name: of the material.
        surface: what it looks like.
        **texture: further attributes.
    """
    root.asset.add(
        "material", name=name, rgba=surface.rgba, specular=surface.specular,
        shininess=surface.shininess, **texture,
    )  # fmt: skip


def add_room(root: mjcf.RootElement, middle: float, look: Look) -> None:
    """Adds a table whose top is at z = 0, about X = `middle` [m], and what is around it."""
    root.asset.add(
        "texture", name="sky", type="skybox", builtin="gradient", rgb1=looks.HORIZON,
        rgb2=looks.SKY, width=64, height=384,
    )  # fmt: skip
    root.visual.rgba.haze = [*looks.HORIZON, 1.0]
    picture = plaster(look.texture_size, looks.TABLE.rgba[:3])
    root.asset.add("texture", name="table", type="2d", file=picture)
    white = looks.Surface((1.0, 1.0, 1.0, 1.0), looks.TABLE.specular, looks.TABLE.shininess)
    add_material(root, "table", white, texture="table", texrepeat=[1, 1], texuniform="true")
    add_material(root, "table_edge", looks.TABLE_EDGE)
    add_material(root, "room", looks.ROOM)
    for name, thickness, top in (("table", SHEET, 0.0), ("table_edge", TOP, -SHEET)):
        root.worldbody.add(
            "geom", name=name, type="box", size=[*HALF_SIDES, thickness / 2],
            pos=[middle, 0.0, top - thickness / 2], material=name, **_SEEN,
        )  # fmt: skip
    root.worldbody.add(
        "geom", name="room", type="plane", size=[0.0, 0.0, 0.1], pos=[middle, 0.0, -HEIGHT],
        material="room", **_SEEN,
    )  # fmt: skip


def add_lights(root: mjcf.RootElement, middle: float, camera: float, look: Look) -> None:
    """Adds the lights: where they stand depends on where the task's camera does.

    Args:
        root: the model.
        middle: X [m] of what they shine at.
        camera: azimuth of the task's camera [rad].
        look: how fine shadows are.
    """
    quality, headlight = root.visual.quality, root.visual.headlight
    quality.shadowsize, quality.offsamples = look.shadow_size, look.samples
    headlight.ambient, headlight.diffuse = [looks.AMBIENT] * 3, [looks.HEADLIGHT] * 3
    headlight.specular = [0.0] * 3
    for light in looks.LIGHTS:
        azimuth = camera + math.radians(light.azimuth)
        elevation = math.radians(light.elevation)
        flat = math.cos(elevation)
        place = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
        root.worldbody.add(
            "light", name=light.name, pos=LAMP_DISTANCE * place + [middle, 0.0, 0.0], dir=-place,
            directional="true", diffuse=light.diffuse, specular=light.specular,
            castshadow=str(light.has_shadow).lower(),
        )  # fmt: skip
