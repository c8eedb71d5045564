"""Lights of a scene."""

import dataclasses
import math

import numpy as np
from dm_control import mjcf

from softgym_mj.rendering import look as looks
from softgym_mj.rendering.look import Light, Look
from softgym_mj.variations.parametric import Parametric
from softgym_mj.variations.randomization import (
    Parameter,
    choice_parameter,
    decode_choice,
    scaled_parameter,
    shifted_parameter,
)

DISTANCE = 3.0  # [m] Distance of the lights from the middle of the scene.
WHITE = 6500.0  # [K] Daylight: the white balance of cameras.
_PLANCK = 0.014388  # [m K] Second radiation constant.
_WAVELENGTHS = np.array([600e-9, 550e-9, 450e-9])  # [m] Red, green and blue.
LAMPS = ("none", "one", "two")
# Ranges of the lamps' brightness, temperature [K] and elevation [deg].
BRIGHTNESS, TEMPERATURE, ELEVATION = (0.08, 0.25), (2800.0, 8000.0), (20.0, 70.0)


def warmth(temperature: float) -> np.ndarray:
    """Returns factors (3,) on a light's color for a black body of a temperature [K].

    They follow Planck's law relative to `WHITE`, at the same brightness of green; pixel values are
    powers of light.
    """
    exponents = _PLANCK / _WAVELENGTHS
    ratios = np.expm1(exponents / WHITE) / np.expm1(exponents / temperature)
    return (ratios / ratios[1]) ** (1.0 / looks.GAMMA)


def lamps(number: int, seed: int) -> list[Light]:
    """Returns a number of random lamps with shadows."""
    random = np.random.Generator(np.random.PCG64(seed))
    found = []
    for i in range(number):
        red, green, blue = random.uniform(*BRIGHTNESS) * warmth(random.uniform(*TEMPERATURE))
        azimuth, elevation = random.uniform(-180.0, 180.0), random.uniform(*ELEVATION)
        color = (red, green, blue)
        found.append(Light(f"lamp_{i}", azimuth, elevation, color, has_shadow=True))
    return found


class Lights(Parametric):
    """Lights, placed relative to the task's camera."""

    parameters = (
        shifted_parameter(
            "light_azimuth", "deg", 40.0, 150.0, "rotation of the key light about Z", "visual"
        ),
        Parameter(
            "light_elevation", "deg", looks.LIGHTS[0].elevation, (40.0, 70.0), (25.0, 85.0),
            "elevation of the key light", "visual",
        ),
        scaled_parameter(
            "light_brightness", "", 1.0, 1.15, 1.4, "factor on the key light", "visual"
        ),
        Parameter(
            "light_temperature", "K", WHITE, (4500.0, 8500.0), (2800.0, 14000.0),
            "color of the key light", "visual",
        ),
        scaled_parameter(
            "ambient_brightness", "", 1.0, 1.15, 1.3, "factor on ambient light", "visual"
        ),
        choice_parameter("lamps", LAMPS, 2, "further lamps with shadows"),
    )  # fmt: skip

    def __init__(self, root: mjcf.RootElement, middle: float, camera: float, look: Look):
        """Adds the lights to a model.

        Args:
            root: the model.
            middle: X [m] of the point that they illuminate.
            camera: azimuth of the task's camera [rad].
            look: rendering detail of shadows.
        """
        self._root, self._middle = root, middle
        quality, headlight = root.visual.quality, root.visual.headlight
        quality.shadowsize, quality.offsamples = look.shadow_size, look.samples
        quality.numslices, quality.numstacks = look.slices, look.slices // 2
        headlight.specular = [0.0] * 3
        self._camera = camera
        self._lights: list[mjcf.Element] = []
        self._set_parameters()

    def _set_parameters(self) -> None:
        values, (key, *others) = self._values, looks.LIGHTS
        ambient = values["ambient_brightness"]
        headlight = self._root.visual.headlight
        headlight.ambient = [ambient * looks.AMBIENT] * 3
        headlight.diffuse = [ambient * looks.HEADLIGHT] * 3
        brightness, temperature = values["light_brightness"], values["light_temperature"]
        turned = dataclasses.replace(
            key, azimuth=key.azimuth + values["light_azimuth"], elevation=values["light_elevation"]
        )
        for light in self._lights:
            light.remove()
        self._lights = [
            self._add(turned, brightness * warmth(temperature)),
            *(self._add(light, ambient) for light in others),
            *(self._add(lamp, 1.0) for lamp in lamps(*decode_choice(values["lamps"], len(LAMPS)))),
        ]

    def _add(self, light: Light, factor: float | np.ndarray) -> mjcf.Element:
        turn, rise = self._camera + math.radians(light.azimuth), math.radians(light.elevation)
        flat = math.cos(rise)
        place = np.array([flat * math.cos(turn), flat * math.sin(turn), math.sin(rise)])
        return self._root.worldbody.add(
            "light", name=light.name, pos=DISTANCE * place + [self._middle, 0.0, 0.0], dir=-place,
            directional="true", diffuse=factor * np.array(light.diffuse), specular=light.specular,
            castshadow=str(light.has_shadow).lower(),
        )  # fmt: skip
