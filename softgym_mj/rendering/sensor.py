"""`Sensor`: what makes a camera's picture worse than a drawn one."""

import dataclasses

import numpy as np

LOSSLESS = 100  # Quality from which an image is not compressed.


@dataclasses.dataclass(frozen=True)
class Sensor:
    """A camera's faults, in the order in which they happen; none by default.

    Attributes:
        blur: standard deviation of the blur of the lens [pixels].
        exposure: factor to pixels; they end at 255.
        noise: standard deviation of the noise, of each pixel and colour [1/255].
        quality: of JPEG, 1..100, rounded; `LOSSLESS` is without.
    """

    blur: float = 0.0
    exposure: float = 1.0
    noise: float = 0.0
    quality: float = LOSSLESS

    def __call__(self, images: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Images (..., height, width, 3) uint8 as it would take them.

        Args:
            images: what it sees.
            random: source of the noise.
        """
        light = images.astype(np.float32)
        if self.blur > 0.0:
            from scipy import ndimage

            light = ndimage.gaussian_filter(light, self.blur, mode="nearest", axes=(-3, -2))
        light *= np.float32(self.exposure)
        if self.noise > 0.0:
            noise = random.standard_normal(light.shape, np.float32)
            light += np.float32(self.noise) * noise
        taken = np.round(np.clip(light, 0.0, 255.0)).astype(np.uint8)
        if round(self.quality) < LOSSLESS:
            flat = taken.reshape(-1, *taken.shape[-3:])
            taken = np.array([_compressed(image, round(self.quality)) for image in flat])
        return taken.reshape(images.shape)


def _compressed(image: np.ndarray, quality: int) -> np.ndarray:
    """An image (height, width, 3) uint8 that was a JPEG."""
    import imageio.v3 as imageio

    file = imageio.imwrite("<bytes>", image, extension=".jpeg", quality=quality)
    return imageio.imread(file, extension=".jpeg")
