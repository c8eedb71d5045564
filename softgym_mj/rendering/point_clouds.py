"""Point clouds from depth images and masks."""

import numpy as np

from softgym_mj.native.arithmetic import squares
from softgym_mj.rendering.calibration import Calibration

NUM_CLOUD_POINTS = 1024
FINEST_CELL = 1e-4  # [m] Closer points count as one.
_HALVINGS = 12  # Bisection steps of the cell size.


def seen_points(depth: np.ndarray, shown: np.ndarray, calibration: Calibration) -> np.ndarray:
    """Returns world points (n, 3) [m] of masked pixels.

    Args:
        depth: Depth image (height, width) [m].
        shown: Mask (height, width) bool.
        calibration: Calibration of the camera for this image size.
    """
    rows, columns = np.nonzero(shown)
    depths = depth[rows, columns].astype(float)
    return calibration.unproject(np.column_stack([columns, rows]), depths)


def thinned(points: np.ndarray, number: int) -> np.ndarray:
    """Selects `number` of points (n, 3), evenly spread; all if there are fewer.

    It selects the point nearest to the center of each cell of the coarsest cubic grid that has
    points in `number` cells. Regions near a camera, or visible to several, thus get no more points
    than others. This takes 2 ms for two images of 128 x 128 pixels; farthest-point sampling would
    take 100 ms.
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
    if len(chosen) < number:  # Many points coincide.
        chosen = order
    return points[chosen[np.linspace(0, len(chosen) - 1, number).astype(int)]]


def _cells(places: np.ndarray, side: float) -> np.ndarray:
    """Returns the index (n,) of the grid cell of each point (n, 3)."""
    x, y, z = (places / side).astype(np.int64).T
    return (x << 42) + (y << 21) + z


def cloud(points: np.ndarray) -> np.ndarray:
    """Returns `NUM_CLOUD_POINTS` rows (x, y, z, 1) float32 of thinned points; the rest are 0."""
    kept = thinned(points, NUM_CLOUD_POINTS)
    padded = np.zeros((NUM_CLOUD_POINTS, 4), np.float32)
    padded[: len(kept), :3] = kept
    padded[: len(kept), 3] = 1.0
    return padded
