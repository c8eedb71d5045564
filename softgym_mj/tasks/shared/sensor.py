"""`TaskSensor`: domain parameters of the cameras of observed images."""

from collections.abc import Mapping

import numpy as np

from softgym_mj.rendering.sensor import LOSSLESS, Sensor
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.variations.indices import generator
from softgym_mj.variations.randomization import Parameter, scaled_parameter


class TaskSensor:
    """Degrades observed color images; images of `render`, depths and labels are unchanged.

    An image depends on the variation and on the time in the episode, not on the number of images.

    Attributes:
        parameters: domain parameters.
    """

    parameters = (
        Parameter("sensor_blur", "pixels", 0.0, (0.0, 0.6), (0.0, 1.3), "sigma of blur", "sensor"),
        scaled_parameter(
            "sensor_exposure", "", 1.0, 1.15, 1.35, "factor on pixel values", "sensor"
        ),
        Parameter(
            "sensor_noise", "1/255", 0.0, (0.0, 4.0), (0.0, 10.0), "sigma of pixel noise", "sensor"
        ),
        Parameter(
            "sensor_quality", "", LOSSLESS, (60.0, LOSSLESS), (25.0, LOSSLESS),
            "JPEG quality; 100 for no compression", "sensor",
        ),
    )  # fmt: skip

    def __init__(self) -> None:
        self._sensor = Sensor()

    def adjust(self, values: Mapping[str, float]) -> bool:
        """Sets all parameters; returns False, as the model does not change."""
        faults = {name.removeprefix("sensor_"): value for name, value in values.items()}
        self._sensor = Sensor(**faults)
        return False

    def seen(self, images: np.ndarray, name: str, variation: int, time: float) -> np.ndarray:
        """Returns observed images for rendered images.

        Args:
            images: (..., height, width, 3) uint8.
            name: name of the observation.
            variation: index.
            time: time in the episode [s].
        """
        if self._sensor == Sensor():
            return images
        return self._sensor(images, generator(f"{name}/{round(time / SIM_STEP)}", variation))
