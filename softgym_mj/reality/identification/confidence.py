"""Intervals of what searches found: from how frames differ and from how searches do.

Where a search ended, offsets are taken as linear. The least squares of these are found again and
again for other frames (blocks of neighbours, drawn with replacement): what they vary by is what
noise, and errors of the model that are not the same in all frames, leave open. What no frame shows
is drawn from all that was searched; so is what seems to show only by the roughness of evaluations,
through which slopes were laid. To it comes the variance between searches. An error of the
model that all frames have in common is not in it.
"""

import numpy as np
import scipy.linalg

from softgym_mj.reality.identification.search import Found

BLOCK = 5  # Neighbouring frames that count as one: their errors are alike.
_REPEATS = 400
# How much of products of slopes is taken to be by chance, to what is by chance on average.
_CHANCE = 2.0
_TWO_SIDED = 1.96  # Standard deviations of 95 % of a normal distribution.


def intervals(
    searches: list[Found], estimate: np.ndarray, bounds: np.ndarray, frames: list[int]
) -> np.ndarray:
    """95 % intervals (unknowns, 2) of coordinates, within bounds.

    Args:
        searches: where they have come to, at least one.
        estimate: (unknowns,) coordinates.
        bounds: (unknowns, 2).
        frames: how many each recording has.
    """
    best = min(searches, key=lambda found: found.loss)
    variance = _steps(best, bounds, frames).var(axis=0)
    if len(searches) > 1:
        variance = variance + np.var([found.estimate for found in searches], axis=0, ddof=1)
    reach = _TWO_SIDED * np.sqrt(variance)
    wide = np.column_stack([estimate - reach, estimate + reach])
    return np.clip(wide, bounds[:, :1], bounds[:, 1:])


def _steps(found: Found, bounds: np.ndarray, frames: list[int]) -> np.ndarray:
    """Ways (repeats, unknowns) to the least squares of frames that are drawn."""
    recordings = [np.arange(number) // BLOCK for number in frames]
    sizes = [int(blocks[-1]) + 1 for blocks in recordings]
    firsts = np.cumsum([0, *sizes[:-1]])
    blocks = np.concatenate([b + first for b, first in zip(recordings, firsts, strict=True)])
    of_rows = blocks[found.frames]
    rows = [np.flatnonzero(of_rows == block) for block in range(sum(sizes))]
    slopes = _real(found.slopes, found.spurious)
    squares = np.array([slopes[some].T @ slopes[some] for some in rows])
    falls = np.array([slopes[some].T @ found.offsets[some] for some in rows])
    # Before anything was seen each number was anywhere within its bounds: one more offset, of the
    # scale of a block's, that its distance from a place there changes.
    wide = np.diff(bounds)[:, 0]
    known = np.sum(found.offsets**2) / len(rows) / wide**2
    random = np.random.default_rng(0)
    steps = []
    for _ in range(_REPEATS):
        counts = np.concatenate(
            [np.bincount(random.integers(0, size, size), minlength=size) for size in sizes]
        )
        places = wide * random.standard_normal(len(wide))
        matrix = np.einsum("b,bij->ij", counts, squares) + np.diag(known)
        steps.append(np.linalg.solve(matrix, known * places - counts @ falls))
    return np.array(steps)


def _real(slopes: np.ndarray, spurious: np.ndarray) -> np.ndarray:
    """Slopes (n, unknowns) less what is in their products by chance (unknowns, unknowns)."""
    products = slopes.T @ slopes
    tiny = 1e-12 * np.trace(products) * np.eye(len(products))
    shares, axes = scipy.linalg.eigh(spurious, products + tiny)
    left = np.sqrt(np.clip(1.0 - _CHANCE * shares, 0.0, 1.0))
    return slopes @ (axes * left) @ np.linalg.inv(axes)
