"""`save_numpy_as_gif` of SoftGym's `utils.visualization`."""

import pathlib

import numpy as np
from PIL import Image

from softgym_mj.exceptions import InvalidArgumentError, check_number
from softgym_mj.validation import typed


@typed
def save_numpy_as_gif(
    array: np.ndarray, filename: str | pathlib.Path, fps: float = 20, scale: float = 1.0
) -> None:
    """Writes images as a looping GIF; unlike SoftGym's, it returns nothing.

    Args:
        array: Images (n, height, width, 3) or (n, height, width), 0 to 255.
        filename: Path of the file; its suffix becomes ".gif".
        fps: Images per second; GIF rounds the time of an image to 10 ms.
        scale: Factor of height and width.
    """
    for name, value in (("fps", fps), ("scale", scale)):
        check_number(name, value, gt=0)
    if array.ndim not in (3, 4) or not array.size or array.shape[3:] not in ((), (3,)):
        valid = "images (n, height, width, 3) or (n, height, width)"
        raise InvalidArgumentError("array", array.shape, valid)
    frames = [Image.fromarray(image.astype(np.uint8)).convert("RGB") for image in array]
    width, height = (max(1, round(scale * side)) for side in frames[0].size)
    size = width, height
    first, *others = [frame if frame.size == size else frame.resize(size) for frame in frames]
    file = pathlib.Path(filename).with_suffix(".gif")
    first.save(file, save_all=True, append_images=others, duration=1000 / fps, loop=0)
