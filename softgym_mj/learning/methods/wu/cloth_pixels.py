"""Classification of cloth pixels in images of the task's camera, by color.

Wu et al.'s thresholds (any channel below 50, or red above 160 with green below 180) are for
SoftGym's colors. Here table, room and shadows are nearly gray, and cloth is linen or crimson: what
is saturated is cloth, but for the picker's orange ring, which is the only thing that is both as
saturated as crimson and as yellow as linen. Numbers were chosen by `segmentation` of 64 x 64 images
of spread_cloth and fold_cloth in nominal colors; most errors are pixels that an edge shares.
"""

import torch
from torch import Tensor

_SATURATED = 0.22  # (max - min) / max: about half of what a pixel has that is linen alone.
_RING = 0.45  # More than linen has; the picker's ring has up to 0.9.
_YELLOW = 0.2  # (green - blue) / max of linen and ring; that of crimson is below 0.


def cloth_pixels(images: Tensor) -> Tensor:
    """Returns whether each pixel shows cloth (..., height, width), of uint8 images (..., 3)."""
    colors = images.float()
    largest, smallest = colors.amax(-1), colors.amin(-1)
    saturation = (largest - smallest) / largest.clamp(min=1.0)
    yellow = (colors[..., 1] - colors[..., 2]) / largest.clamp(min=1.0)
    return (saturation > _SATURATED) & ~((saturation > _RING) & (yellow > _YELLOW))


def pixel_centers(height: int, width: int, device: torch.device | str = "cpu") -> Tensor:
    """Returns pixel centers (height * width, 2), row by row: right and down, from -1 to 1."""
    down, right = (
        (2.0 * torch.arange(number, device=device) + 1.0) / number - 1.0
        for number in (height, width)
    )
    return torch.stack([right.repeat(height), down.repeat_interleave(width)], -1)
