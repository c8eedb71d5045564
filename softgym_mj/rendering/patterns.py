"""Patterns: share of a second tone at each point of a square."""

import numpy as np

FABRICS = ("plain", "stripes", "checks", "dots", "diamonds")
ROPES = ("plain", "tracer", "bands")
FEWEST, MOST = 4, 10  # Smallest and largest number of repeats along a side.
# Factor of a darker second tone, and share of white in a lighter one: with more contrast the two
# sides of a cloth are hard to distinguish.
SHADE, LIGHT = 0.5, 0.3


def second_tone(color: np.ndarray, seed: int) -> np.ndarray:
    """Returns the second tone of a color (3,) in 0..1: a darker or a lighter one."""
    is_light = np.random.Generator(np.random.PCG64(seed)).random() < 0.5
    return color + LIGHT * (1.0 - color) if is_light else SHADE * color


def pattern(name: str, seed: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Returns the share (h, w) of the second tone.

    Args:
        name: One of `FABRICS` or `ROPES`.
        seed: Seed of numbers and widths.
        rows, columns: Coordinates (h,) and (w,) in 0..1 along the sides of the square; of a rope,
            along and around it.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    number, share = random.integers(FEWEST, MOST + 1), random.uniform(0.25, 0.5)
    is_upright = random.random() < 0.5
    v, u = number * rows[:, None], number * columns[None, :]
    down, across = (((place % 1.0) < share).astype(float) for place in (v, u))
    along = np.floor(v)
    shifted = u + 0.5 * (along % 2.0)  # Every second row is shifted by half a step.
    shares: dict[str, np.ndarray] = {
        "plain": np.zeros(1),
        "stripes": across if is_upright else down,
        "checks": (down + across) / 2.0,
        "dots": np.hypot(v - along - 0.5, shifted % 1.0 - 0.5) < 0.8 * share,
        "diamonds": ((u + v) % 1.0 < 0.5) == ((u - v) % 1.0 < 0.5),
        "tracer": columns[None, :] < share,  # One colored strand.
        "bands": down,
    }
    return np.broadcast_to(shares[name], (len(rows), len(columns))).astype(float)
