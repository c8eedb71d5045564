"""Clouds of points of what cameras see, from their depths and from masks of what counts."""

import numpy as np

from softgym_mj.native.arithmetic import squares
from softgym_mj.rendering.calibration import Calibration

NUM_CLOUD_POINTS = 1024
FINEST_CELL = 1e-4  # [m] Points that are nearer to each other count as one.
_HALVINGS = 12  # Of the interval that the side of cells is sought in.


def seen_points(depth: np.ndarray, shown: np.ndarray, calibration: Calibration) -> np.ndarray:
    """Points (n, 3) [m] of the world that pixels show.

    Args:
        depth: (height, width) [m].
        shown: (height, width) bool: which pixels count.
        calibration: of the camera, for images of this size.
    """
    rows, columns = np.nonzero(shown)
    depths = depth[rows, columns].astype(float)
    return calibration.unproject(np.column_stack([columns, rows]), depths)


def thinned(points: np.ndarray, number: int) -> np.ndarray:
    """As many of points (n, 3) as `number`, spread evenly over where there are any; all if fewer.

    From each cell of the coarsest cubic grid that has points in so many cells it takes the one that
    is nearest to the cell's middle: what lies near to a camera, or is seen by several, gets no more
    than the rest. That takes 2 ms for two images of 128 x 128 pixels; choosing always the point
    that is farthest from the chosen ones would take 100 ms.
    """
    if len(points) <= number:
        return points
    places = points - points.min(axis=0)
    fine, coarse = FINEST_CELL, max(float(places.max()), FINEST_CELL)
    for _ in range(_HALVINGS):
        side = (fine + coarse) / 2
        if len(np.unique(_cells(places, side))) < number:
            coarse = side
        else:
            fine = side
    cells = _cells(places, fine)
    away = squares(places / fine % 1.0 - 0.5)
    order = np.lexsort((away, cells))
    chosen = order[np.unique(cells[order], return_index=True)[1]]
    if len(chosen) < number:  # Many coincide.
        chosen = order
    return points[chosen[np.linspace(0, len(chosen) - 1, number).astype(int)]]


def _cells(places: np.ndarray, side: float) -> np.ndarray:
    """A number (n,) of the cell of a grid that each of (n, 3) is in."""
    x, y, z = (places / side).astype(np.int64).T
    return (x << 42) + (y << 21) + z


def cloud(points: np.ndarray) -> np.ndarray:
    """`NUM_CLOUD_POINTS` of points (n, 3), `thinned`: (1024, 4) float32, with 1 or rows of 0."""
    kept = thinned(points, NUM_CLOUD_POINTS)
    padded = np.zeros((NUM_CLOUD_POINTS, 4), np.float32)
    padded[: len(kept), :3] = kept
    padded[: len(kept), 3] = 1.0
    return padded
