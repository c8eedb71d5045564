"""The faults of a sensor, against PIL's JPEG and sums written out."""

import io

import numpy as np
import pytest
from PIL import Image

from softgym_mj.rendering.sensor import Sensor


def picture(*lead):
    shape = (*lead, 40, 56, 3)
    smooth = np.random.default_rng(0).normal(size=shape).cumsum(-2).cumsum(-3)
    return np.clip(128 + 4 * smooth, 0, 255).astype(np.uint8)


def taken(image, seed=0, **faults):
    return Sensor(**faults)(image, np.random.default_rng(seed))


def test_without_faults_no_bit_changes():
    assert taken(picture()).tobytes() == picture().tobytes()


@pytest.mark.parametrize("quality", [20, 61.7, 95])
def test_compression_is_that_of_jpeg(quality):
    file = io.BytesIO()
    Image.fromarray(picture()).save(file, "jpeg", quality=round(quality))
    np.testing.assert_array_equal(
        taken(picture(), quality=quality), np.asarray(Image.open(file)), strict=True
    )


def test_blur_is_a_gaussian_mean():
    """Each pixel is a mean of those around it; beyond the edge the image goes on as there."""
    deviation, image = 1.3, picture()
    reach = np.arange(-8, 9)
    weights = np.exp(-(reach**2) / (2 * deviation**2))
    padded = np.pad(image.astype(float), [(8, 8), (8, 8), (0, 0)], mode="edge")
    expected = np.zeros(image.shape)
    for i, down in enumerate(weights):
        for j, across in enumerate(weights):
            expected += down * across * padded[i : i + 40, j : j + 56]
    expected /= weights.sum() ** 2
    assert np.abs(taken(image, blur=deviation) - expected).max() < 1.0  # Rounding, and the tails.


def test_noise_has_its_deviation_and_its_seed():
    gray = np.full((200, 200, 3), 128, np.uint8)
    noisy = taken(gray, noise=6.0)
    assert noisy.std() == pytest.approx(6.0, rel=0.02) and noisy.mean() == pytest.approx(128, abs=1)
    assert noisy.tobytes() == taken(gray, noise=6.0).tobytes()
    assert noisy.tobytes() != taken(gray, seed=1, noise=6.0).tobytes()


def test_exposure_is_a_factor_that_ends_at_white():
    image = picture()
    expected = np.round(np.minimum(1.3 * image, 255.0))
    assert np.abs(taken(image, exposure=1.3) - expected).max() <= 1


def test_images_of_several_cameras():
    images = picture(2)
    faults = {"blur": 0.8, "exposure": 1.2, "quality": 50}
    for both, one in zip(taken(images, **faults), images, strict=True):
        np.testing.assert_array_equal(both, taken(one, **faults))
