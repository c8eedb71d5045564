"""Observation presets as data, and the camera observable."""

from collections.abc import Sequence

import numpy as np
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj.exceptions import UnknownNameError
from softgym_mj.rendering import CameraView

# name: what it is. Positions are in metres, in the world frame.
OBSERVATIONS = {
    "full": "every point (zero-padded to the largest variation), then the grippers or cups",
    "reduced": "the few numbers that describe the state, listed in the task's docstring",
    "rgb": "uint8 image (height, width, 3) from the task camera",
}
DEFAULT_IMAGE_SIZE = (128, 128)  # (height, width), as in the paper's experiments.


def enabled_names(observation: str | Sequence[str]) -> tuple[str, ...]:
    """The observation names that a setting asks for.

    Args:
        observation: one name, or a sequence of distinct names.

    Raises:
        UnknownNameError: for a name that does not exist, none or one given twice.
    """
    names = (observation,) if isinstance(observation, str) else observation
    if not isinstance(names, Sequence):
        raise UnknownNameError("observation", observation, OBSERVATIONS)
    names = tuple(names)
    if not names or len(set(names)) != len(names) or not set(names) <= set(OBSERVATIONS):
        raise UnknownNameError("observation", observation, OBSERVATIONS)
    return names


class CameraObservable(observable.Generic):
    """An RGB image (height, width, 3) uint8 from a fixed camera."""

    def __init__(self, camera: str, height: int, width: int):
        self._view = CameraView(camera, height, width)
        self._spec = specs.BoundedArray((height, width, 3), np.uint8, 0, 255)
        super().__init__(self._view.rgb)

    @property
    def array_spec(self) -> specs.BoundedArray:
        return self._spec
