"""`Look`: how a scene is drawn; and what it is lit by, whoever draws it.

Nothing here is felt: states are the same bits under every look.
"""

import dataclasses
from typing import TYPE_CHECKING

from softgym_mj.exceptions import InvalidArgumentError

if TYPE_CHECKING:
    import mujoco

TEXT = "look"  # Of a model: the name of its look.
Color = tuple[float, float, float]  # (r, g, b) in 0..1.


@dataclasses.dataclass(frozen=True)
class Look:
    """How finely a scene is drawn.

    Attributes:
        name: its name in `LOOKS`.
        shadow_size: side of the map of shadows [texels].
        samples: of which a pixel is the mean, in one pass.
        passes: pictures that are averaged, with the sun and the camera moved a little: soft shadows
            and smooth edges.
        film_passes: the same for each picture of a film.
        refinement: edges of a drawn sheet along one of its mesh.
        texture_size: side of a texture [texels].
        threads: of the weave along a side of a sheet.
        rope_sides, rope_rings: of a drawn rope: corners of its section, sections along an edge.
        is_stranded: whether ropes have strands.
        is_endless: whether the floor of the room vanishes in haze.
        slices: corners of what stands for a circle.
        water_cell: side of the grid that the surface of water is found on [rest distances].
        water_triangles: largest number of triangles of this surface; larger cells, and fewer
            drops, keep it below.
    """

    name: str
    shadow_size: int
    samples: int
    passes: int
    film_passes: int
    refinement: int
    texture_size: int
    threads: int
    rope_sides: int
    rope_rings: int
    is_stranded: bool
    is_endless: bool
    slices: int
    water_cell: float
    water_triangles: int


# Spilled water takes about 14 triangles a particle: 24,000 show 1,700 particles in full.
FAST = Look("fast", 256, 4, 1, 1, 1, 256, 24, 8, 3, False, False, 16, 1.25, 24_000)
PAPER = Look("paper", 2048, 4, 24, 1, 4, 2048, 180, 24, 8, True, True, 40, 0.5, 24_000)
LOOKS = {look.name: look for look in (FAST, PAPER)}


def look_of(model: "mujoco.MjModel") -> Look:
    """The look that a model was compiled for; `FAST` if it does not say."""
    import mujoco

    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, TEXT)
    if text < 0:
        return FAST
    first = model.text_adr[text]
    return LOOKS[bytes(model.text_data[first : first + model.text_size[text] - 1]).decode()]


def find_look(look: str) -> Look:
    """The look of a name in `LOOKS`.

    Raises:
        InvalidArgumentError: if there is none.
    """
    if look not in tuple(LOOKS):
        raise InvalidArgumentError("look", look, LOOKS)
    return LOOKS[look]


@dataclasses.dataclass(frozen=True)
class Light:
    """A lamp that is far away.

    Attributes:
        name: its name.
        azimuth: to its place, counter-clockwise from where the task's camera stands [deg].
        elevation: of its place [deg].
        diffuse: colour of its light.
        specular: that of its reflections.
        has_shadow: whether what it does not reach is in shadow.
    """

    name: str
    azimuth: float
    elevation: float
    diffuse: Color
    specular: Color = (0.0, 0.0, 0.0)
    has_shadow: bool = False


# The sun stands to the right behind the camera: from elsewhere, sheets that hang show it their dark
# side. The others light what is in shadow and the far edges.
LIGHTS = (
    Light("key", 45.0, 55.0, (0.56, 0.55, 0.53), (0.3, 0.3, 0.3), has_shadow=True),
    Light("fill", -60.0, 40.0, (0.14, 0.15, 0.17)),
    Light("rim", 170.0, 30.0, (0.10, 0.10, 0.11)),
)
AMBIENT, HEADLIGHT = 0.32, 0.10  # Light from all sides, and from the camera.
SKY, HORIZON = (0.86, 0.88, 0.90), (0.93, 0.935, 0.94)
GAMMA = 2.2  # Of pixels: they are powers of light.
SUN_RADIUS = 0.28  # Of the disc in which the sun is moved between passes, at the distance 1.


@dataclasses.dataclass(frozen=True)
class Surface:
    """What a thing looks like from near.

    Attributes:
        rgba: colour and opacity; (1, 1, 1, 1) if its texture has the colours.
        specular: strength of its reflections, 0..1.
        shininess: how sharp they are, 0..1.
    """

    rgba: tuple[float, float, float, float]
    specular: float = 0.0
    shininess: float = 0.0


TABLE = Surface((0.80, 0.79, 0.77, 1.0))
TABLE_EDGE = Surface((0.62, 0.48, 0.34, 1.0))
ROOM = Surface((0.74, 0.74, 0.74, 1.0))
FABRIC = Surface((1.0, 1.0, 1.0, 1.0), 0.05, 0.05)
ROPE_SURFACE = Surface((1.0, 1.0, 1.0, 1.0), 0.15, 0.2)
GLASS = Surface((0.75, 0.86, 0.90, 0.22), 0.9, 0.9)
WATER = Surface((0.10, 0.42, 0.75, 0.5), 0.8, 0.9)
STEEL = Surface((0.63, 0.65, 0.68, 1.0), 0.5, 0.6)
GRAPHITE = Surface((0.25, 0.27, 0.30, 1.0), 0.25, 0.3)
SIGNAL = Surface((0.95, 0.52, 0.10, 1.0), 0.2, 0.3)
