"""Intervals of what searches found: from the loss's curvature and from how searches differ.

Near the least loss a quadratic is fitted to the evaluations that searches made, and its minimum is
one estimate. It is made again and again with other frames (blocks of neighbours, drawn with
replacement) and other evaluations (likewise): what the minimum varies by is what noise and the
roughness of the loss leave open. To it comes the variance between searches. What no frame shows,
an error of the model that all have in common, is not in it.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from softgym_mj.reality.identification.quadratic import coefficients, minimum
from softgym_mj.reality.identification.search import Found

BLOCK = 5  # Neighbouring frames that count as one: their errors are alike.
_REPEATS = 200
_PER_COEFFICIENT = 4  # Evaluations for each coefficient of the quadratic.
_TWO_SIDED = 1.96  # Standard deviations of 95 % of a normal distribution.


def intervals(
    searches: list[Found],
    estimate: np.ndarray,
    bounds: np.ndarray,
    frames: list[int],
    shares: Sequence[float],
) -> np.ndarray:
    """95 % intervals (unknowns, 2) of coordinates, within bounds.

    Args:
        searches: what they have looked at, at least one.
        estimate: (unknowns,) coordinates.
        bounds: (unknowns, 2).
        frames: how many each recording has.
        shares: of recordings in the loss.
    """
    points = np.concatenate([found.points for found in searches])
    losses = np.concatenate([found.losses for found in searches])
    distances = np.concatenate([found.frames for found in searches])
    most = _PER_COEFFICIENT * coefficients(len(estimate))
    best = np.argsort(losses, kind="stable")[:most]
    drawn = functools.partial(_weights, frames, shares)
    minima = _minima(points[best], distances[best], bounds, drawn)
    variance = minima.var(axis=0)
    if len(searches) > 1:
        variance = variance + np.var([found.estimate for found in searches], axis=0, ddof=1)
    reach = _TWO_SIDED * np.sqrt(variance)
    wide = np.column_stack([estimate - reach, estimate + reach])
    return np.clip(wide, bounds[:, :1], bounds[:, 1:])


def _minima(
    points: np.ndarray,
    distances: np.ndarray,
    bounds: np.ndarray,
    drawn: Callable[[np.random.Generator], np.ndarray],
) -> np.ndarray:
    """Minima (repeats, unknowns) of quadratics through points (n, unknowns) as frames are drawn."""
    random = np.random.default_rng(0)
    found = []
    for _ in range(_REPEATS):
        rows = random.integers(0, len(points), len(points))
        found.append(minimum(points[rows], distances[rows] @ drawn(random), bounds))
    return np.array(found)


def _weights(frames: list[int], shares: Sequence[float], random: np.random.Generator) -> np.ndarray:
    """How much each frame counts (all frames,) when blocks of each recording are drawn anew."""
    weights = []
    for number, share in zip(frames, shares, strict=True):
        block = np.arange(number) // BLOCK
        most = block[-1] + 1
        drawn = np.bincount(random.integers(0, most, most), minlength=most)
        counts = drawn[block].astype(float)
        weights.append(share * counts / max(counts.sum(), 1.0))
    return np.concatenate(weights)
