"""`Sensor`: degradations of a real camera: blur, exposure, noise and compression."""

import dataclasses

import numpy as np

LOSSLESS = 100  # JPEG quality from which images are not compressed.


@dataclasses.dataclass(frozen=True)
class Sensor:
    """Image degradations in the order in which they are applied; none by default.

    Attributes:
        blur: Standard deviation of the lens blur [pixels].
        exposure: Factor of pixel values, which saturate at 255.
        noise: Standard deviation of the noise of each pixel and color [1/255].
        quality: JPEG quality, 1..100, rounded; `LOSSLESS` disables compression.
    """

    blur: float = 0.0
    exposure: float = 1.0
    noise: float = 0.0
    quality: float = LOSSLESS

    def __call__(self, images: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Returns degraded images (..., height, width, 3) uint8.

        Args:
            images: Rendered images.
            random: Random generator of the noise.
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
    """Returns an image (height, width, 3) uint8 after JPEG compression."""
    import imageio.v3 as imageio

    file = imageio.imwrite("<bytes>", image, extension=".jpeg", quality=quality)
    return imageio.imread(file, extension=".jpeg")
