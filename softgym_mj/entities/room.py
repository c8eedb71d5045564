"""Table and room: visible, without contact."""

import functools
from collections.abc import Callable, Sequence

from dm_control import mjcf

from softgym_mj.rendering import look as looks
from softgym_mj.rendering.look import Color, Look, Surface
from softgym_mj.rendering.textures import granite, plaster, printed, tiles, wood
from softgym_mj.variations.parametric import Parametric
from softgym_mj.variations.randomization import (
    Parameter,
    choice_parameter,
    decode_choice,
    scaled_parameter,
    shifted_parameter,
    tinted,
)

# [m] Table: half its sides, thickness of its top, height above the floor of the room.
HALF_SIDES, TOP, HEIGHT = (1.3, 1.1), 0.04, 0.75
# Room: a plane that vanishes in haze, or a box with a visible far edge that renders in half the
# time.
ENDLESS: dict[str, object] = {"type": "plane", "size": [0.0, 0.0, 0.1]}
LARGE: dict[str, object] = {"type": "box", "size": [15.0, 15.0, 0.001]}
SHEET = 0.002  # [m] Thickness of the laminate on the table.
# Materials and colors of the table; a texture covers two meters.
TABLES: dict[str, tuple[Callable[..., mjcf.Asset], Color]] = {
    "plaster": (plaster, looks.TABLE.rgba[:3]),
    "wood": (wood, (0.72, 0.57, 0.42)),
    "granite": (granite, (0.68, 0.67, 0.65)),
    "tiles": (tiles, (0.80, 0.82, 0.83)),
    "stripes": (functools.partial(printed, name="stripes"), (0.70, 0.74, 0.70)),
    "checks": (functools.partial(printed, name="checks"), (0.76, 0.71, 0.66)),
}
_SEEN = {"contype": 0, "conaffinity": 0, "mass": 0.0}  # Attributes of visible geoms.


def add_material(root: mjcf.RootElement, name: str, surface: Surface, **texture: object) -> None:
    """Adds a material to a model.

    Args:
        root: the model.
        name: name of the material.
        surface: its appearance.
        **texture: further attributes.
    """
    root.asset.add(
        "material", name=name, rgba=surface.rgba, specular=surface.specular,
        shininess=surface.shininess, **texture,
    )  # fmt: skip


class Room(Parametric):
    """Table with its top at z = 0, and the room around it."""

    parameters = (
        choice_parameter("table_pattern", tuple(TABLES), 3, "pattern of the table"),
        scaled_parameter("table_scale", "", 1.0, 1.5, 2.5, "size of the table's pattern", "visual"),
        shifted_parameter("table_hue", "deg", 25.0, 180.0, "hue rotation of the table", "visual"),
        Parameter(
            "table_saturation", "", 0.0, (0.0, 0.1), (0.0, 0.4), "added saturation of the table",
            "visual",
        ),
        Parameter(
            "table_brightness", "", 1.0, (0.75, 1.0), (0.5, 1.0), "factor on the table's color",
            "visual",
        ),
        shifted_parameter(
            "backdrop_hue", "deg", 40.0, 180.0, "hue rotation of sky and room", "visual"
        ),
        Parameter(
            "backdrop_saturation", "", 0.0, (0.0, 0.1), (0.0, 0.4), "added saturation of backdrop",
            "visual",
        ),
        Parameter(
            "backdrop_brightness", "", 1.0, (0.7, 1.0), (0.4, 1.0), "factor on sky and room",
            "visual",
        ),
    )  # fmt: skip

    def __init__(self, root: mjcf.RootElement, middle: float, look: Look):
        """Adds the room to a model.

        Args:
            root: the model.
            middle: X [m] of the middle of the table.
            look: rendering detail of textures.
        """
        self._root, self._size = root, look.texture_size
        self._sky = root.asset.add(
            "texture", name="sky", type="skybox", builtin="gradient", width=64, height=384
        )
        self._texture = root.asset.add("texture", name="table", type="2d")
        white = looks.Surface((1.0, 1.0, 1.0, 1.0), looks.TABLE.specular, looks.TABLE.shininess)
        add_material(root, "table", white, texture="table", texuniform="true")
        add_material(root, "table_edge", looks.TABLE_EDGE)
        add_material(root, "room", looks.ROOM)
        for name, thickness, top in (("table", SHEET, 0.0), ("table_edge", TOP, -SHEET)):
            root.worldbody.add(
                "geom", name=name, type="box", size=[*HALF_SIDES, thickness / 2],
                pos=[middle, 0.0, top - thickness / 2], material=name, **_SEEN,
            )  # fmt: skip
        floor = ENDLESS if look.is_endless else LARGE
        root.worldbody.add(
            "geom", name="room", **floor, pos=[middle, 0.0, -HEIGHT], material="room", **_SEEN
        )
        self._set_parameters()

    def _set_parameters(self) -> None:
        index, seed = decode_choice(self._values["table_pattern"], len(TABLES))
        texture, color = list(TABLES.values())[index]
        self._texture.file = texture(self._size, self._tinted("table", color), seed)
        repeat = 1.0 / self._values["table_scale"]
        self._root.find("material", "table").texrepeat = [repeat, repeat]
        horizon = self._tinted("backdrop", looks.HORIZON)
        self._sky.rgb1, self._sky.rgb2 = horizon, self._tinted("backdrop", looks.SKY)
        self._root.visual.rgba.haze = [*horizon, 1.0]
        self._root.find("material", "room").rgba = self._tinted("backdrop", looks.ROOM.rgba)

    def _tinted(self, thing: str, color: Sequence[float]) -> tuple[float, ...]:
        parts = ("hue", "saturation", "brightness")
        return tinted(color, *(self._values[f"{thing}_{part}"] for part in parts))
