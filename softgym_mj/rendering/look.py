"""`Look`: level of detail of rendering; and the lights of all renderers.

A look does not affect the simulation: states are bit-identical under every look.
"""

import dataclasses
from typing import TYPE_CHECKING

from softgym_mj.exceptions import InvalidArgumentError

if TYPE_CHECKING:
    import mujoco

TEXT = "look"  # Name of a model's MJCF text element with the name of its look.
Color = tuple[float, float, float]  # (r, g, b) in 0..1.


@dataclasses.dataclass(frozen=True)
class Look:
    """Level of detail of rendering.

    Attributes:
        name: Name in `LOOKS`.
        shadow_size: Side of the shadow map [texels].
        samples: Samples per pixel in one pass.
        passes: Averaged passes with slightly moved sun and camera: soft shadows and smooth edges.
        video_passes: Passes for each frame of a video.
        refinement: Rendered edges of a sheet per edge of its mesh.
        texture_size: Side of a texture [texels].
        threads: Threads of the weave along a side of a sheet.
        rope_sides, rope_rings: Corners of a rope's cross section, and sections per edge.
        is_stranded: Whether ropes have strands.
        is_endless: Whether the floor of the room fades into haze.
        slices: Corners of circles.
        water_cell: Cell size of the grid of the water surface [rest distances].
        water_triangles: Largest number of triangles of this surface; larger cells and fewer
            drops keep it below.
    """

    name: str
    shadow_size: int
    samples: int
    passes: int
    video_passes: int
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
    """Returns the look in a model's text element; `FAST` if there is none."""
    import mujoco

    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, TEXT)
    if text < 0:
        return FAST
    first = model.text_adr[text]
    return LOOKS[bytes(model.text_data[first : first + model.text_size[text] - 1]).decode()]


def find_look(look: str) -> Look:
    """Returns a look of `LOOKS` by name.

    Raises:
        InvalidArgumentError: If there is none of this name.
    """
    if look not in tuple(LOOKS):
        raise InvalidArgumentError("look", look, LOOKS)
    return LOOKS[look]


@dataclasses.dataclass(frozen=True)
class Light:
    """A distant light.

    Attributes:
        name: Name of the light.
        azimuth: Azimuth, counterclockwise from the direction of the task's camera [deg].
        elevation: Elevation [deg].
        diffuse: Diffuse color.
        specular: Specular color.
        has_shadow: Whether it casts shadows.
    """

    name: str
    azimuth: float
    elevation: float
    diffuse: Color
    specular: Color = (0.0, 0.0, 0.0)
    has_shadow: bool = False


# The sun is behind the camera to the right, so that hanging sheets are lit on the side that the
# camera sees. The other lights fill shadows and far edges.
LIGHTS = (
    Light("key", 45.0, 55.0, (0.56, 0.55, 0.53), (0.3, 0.3, 0.3), has_shadow=True),
    Light("fill", -60.0, 40.0, (0.14, 0.15, 0.17)),
    Light("rim", 170.0, 30.0, (0.10, 0.10, 0.11)),
)
AMBIENT, HEADLIGHT = 0.32, 0.10  # Intensity of ambient light, and of the light at the camera.
SKY, HORIZON = (0.86, 0.88, 0.90), (0.93, 0.935, 0.94)
GAMMA = 2.2  # Display gamma (sRGB approximation).
SUN_RADIUS = 0.14  # Radius of the disc on which passes move the sun, at distance 1.


@dataclasses.dataclass(frozen=True)
class Surface:
    """Appearance of a surface.

    Attributes:
        rgba: Color and opacity; (1, 1, 1, 1) if a texture provides the colors.
        specular: Strength of reflections, 0..1.
        shininess: Sharpness of reflections, 0..1.
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
