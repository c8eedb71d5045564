"""Patterns: how much of a second tone there is at each place of a square."""

import numpy as np

FABRICS = ("plain", "stripes", "checks", "dots", "diamonds")
ROPES = ("plain", "tracer", "bands")
FEWEST, MOST = 4, 10  # Repeats along a side.
# A second tone is so much of the first, or goes so far towards white: with more, the two sides of a
# cloth are hard to tell apart.
SHADE, LIGHT = 0.5, 0.3


def second_tone(color: np.ndarray, seed: int) -> np.ndarray:
    """What a colour (3,) in 0..1 is combined with: a shade of it, or a lighter one."""
    is_light = np.random.Generator(np.random.PCG64(seed)).random() < 0.5
    return color + LIGHT * (1.0 - color) if is_light else SHADE * color


def pattern(name: str, seed: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Share (h, w) of the second tone.

    Args:
        name: one of `FABRICS` or `ROPES`.
        seed: of numbers and widths.
        rows, columns: places (h,) and (w,), which go from 0 to 1 along the sides of the square;
            of a rope, along and around it.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    number, share = random.integers(FEWEST, MOST + 1), random.uniform(0.25, 0.5)
    is_upright = random.random() < 0.5
    v, u = number * rows[:, None], number * columns[None, :]
    down, across = (((place % 1.0) < share).astype(float) for place in (v, u))
    along = np.floor(v)
    shifted = u + 0.5 * (along % 2.0)  # Every second row is, by half a step.
    shares: dict[str, np.ndarray] = {
        "plain": np.zeros(1),
        "stripes": across if is_upright else down,
        "checks": (down + across) / 2.0,
        "dots": np.hypot(v - along - 0.5, shifted % 1.0 - 0.5) < 0.8 * share,
        "diamonds": ((u + v) % 1.0 < 0.5) == ((u - v) % 1.0 < 0.5),
        "tracer": columns[None, :] < share,  # One strand.
        "bands": down,
    }
    return np.broadcast_to(shares[name], (len(rows), len(columns))).astype(float)
