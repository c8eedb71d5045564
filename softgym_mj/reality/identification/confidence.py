"""Confidence intervals of identified parameters, from the spread of frames and of searches.

Residuals are linearized at the end of a search. Their least-squares problem is solved again and
again for other frames (blocks of neighbors, drawn with replacement): the variance of the solutions
is what noise, and model errors that differ between frames, leave open. Directions that no frame
determines are drawn from the whole range of the search, as are those that only the roughness of
evaluations seems to determine. The variance between searches is added. A model error that all
frames share is not included.
"""

import numpy as np
import scipy.linalg

from softgym_mj.reality.identification.search import SearchResult

BLOCK = 5  # Neighboring frames that count as one: their errors are correlated.
_REPEATS = 400
# Factor on the part of J^T J that is expected by chance.
_CHANCE = 2.0
_TWO_SIDED = 1.96  # Standard deviations of 95 % of a normal distribution.


def intervals(
    searches: list[SearchResult], estimate: np.ndarray, bounds: np.ndarray, frames: list[int]
) -> np.ndarray:
    """Returns 95 % intervals (unknowns, 2) of coordinates, within bounds.

    Args:
        searches: results, at least one.
        estimate: (unknowns,) coordinates.
        bounds: (unknowns, 2).
        frames: number of frames of each recording.
    """
    best = min(searches, key=lambda found: found.loss)
    variance = _steps(best, bounds, frames).var(axis=0)
    if len(searches) > 1:
        variance = variance + np.var([found.estimate for found in searches], axis=0, ddof=1)
    reach = _TWO_SIDED * np.sqrt(variance)
    wide = np.column_stack([estimate - reach, estimate + reach])
    return np.clip(wide, bounds[:, :1], bounds[:, 1:])


def _steps(found: SearchResult, bounds: np.ndarray, frames: list[int]) -> np.ndarray:
    """Returns steps (repeats, unknowns) to the least-squares solutions of resampled frames."""
    recordings = [np.arange(number) // BLOCK for number in frames]
    sizes = [int(blocks[-1]) + 1 for blocks in recordings]
    firsts = np.cumsum([0, *sizes[:-1]])
    blocks = np.concatenate([b + first for b, first in zip(recordings, firsts, strict=True)])
    of_rows = blocks[found.frames]
    rows = [np.flatnonzero(of_rows == block) for block in range(sum(sizes))]
    jacobian = _real(found.jacobian, found.spurious)
    squares = np.array([jacobian[some].T @ jacobian[some] for some in rows])
    falls = np.array([jacobian[some].T @ found.residuals[some] for some in rows])
    # Prior: each coordinate lies anywhere within its bounds. It enters as one more residual, of the
    # scale of a block's, proportional to the distance from a random point there.
    wide = np.diff(bounds)[:, 0]
    known = np.sum(found.residuals**2) / len(rows) / wide**2
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


def _real(jacobian: np.ndarray, spurious: np.ndarray) -> np.ndarray:
    """Returns a Jacobian (n, unknowns) reduced by what J^T J has by chance (unknowns, unknowns)."""
    products = jacobian.T @ jacobian
    tiny = 1e-12 * np.trace(products) * np.eye(len(products))
    shares, axes = scipy.linalg.eigh(spurious, products + tiny)
    left = np.sqrt(np.clip(1.0 - _CHANCE * shares, 0.0, 1.0))
    return jacobian @ (axes * left) @ np.linalg.inv(axes)
