"""Distances of simulated points from real clouds, by the conventions of published benchmarks.

All distances are in meters; clouds are unordered and may differ in size. "Sim to real" uses the
nearest real point of each simulated one, "real to sim" the reverse: points that a camera did not
see affect only the first, points that the simulation lacks only the second.
"""

import dataclasses

import numpy as np
from scipy.spatial import cKDTree

from softgym_mj.exceptions import InvalidArgumentError, check_number

MANHATTAN, EUCLID = 1, 2  # Orders of the norm.


@dataclasses.dataclass(frozen=True)
class RagDistances:
    """Distances of Blanco-Mulero et al. (RA-L 9(3), 2024) for one frame.

    Attributes:
        chamfer: mean over simulated vertices of the Manhattan distance to the nearest real point.
        hausdorff: largest over simulated vertices of the Euclidean distance to the nearest one.
    """

    chamfer: float
    hausdorff: float


def rag_distances(simulated: np.ndarray, real: np.ndarray) -> RagDistances:
    """Returns distances of simulated vertices (n, 3) from a real cloud (m, 3) [m], as for rags.

    Raises:
        InvalidArgumentError: if a cloud is empty, not finite or of another shape.
    """
    simulated, real = _cloud("simulated", simulated), _cloud("real", real)
    return RagDistances(
        chamfer=float(np.mean(_nearest(simulated, real, MANHATTAN))),
        hausdorff=float(np.max(_nearest(simulated, real, EUCLID))),
    )


def symmetric_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Returns half the sum of the mean distances [m] to the nearest point, both directions.

    Args:
        first, second: (n, 3) and (m, 3) [m].

    Raises:
        InvalidArgumentError: if a cloud is empty, not finite or of another shape.
    """
    first, second = _cloud("first", first), _cloud("second", second)
    there, back = _nearest(first, second, EUCLID), _nearest(second, first, EUCLID)
    return float(np.mean(there) + np.mean(back)) / 2


def jitter(positions: np.ndarray, step: float) -> float:
    """Returns the mean norm of the second difference of positions over time [m/s^2].

    It measures unrest of vertices that should be at rest; in motion it includes the acceleration.

    Args:
        positions: (frames, n, 3) [m], at least 3 frames, the same points in each.
        step: time between frames [s].

    Raises:
        InvalidArgumentError: for too few frames, or values that are not finite.
    """
    positions = np.asarray(positions, float)
    if positions.ndim != 3 or positions.shape[2] != 3 or positions.shape[0] < 3:
        raise InvalidArgumentError("positions", positions.shape, "a shape (3 or more, n, 3)")
    check_number("step", step, gt=0.0, lt=np.inf)
    _cloud("positions", positions.reshape(-1, 3))
    second = np.diff(positions, n=2, axis=0) / step**2
    return float(np.mean(np.linalg.norm(second, axis=2)))


def _nearest(points: np.ndarray, cloud: np.ndarray, order: int) -> np.ndarray:
    """Returns distances (n,) [m] of points (n, 3) from the nearest of a cloud (m, 3)."""
    return cKDTree(cloud).query(points, p=order)[0]


def _cloud(argument: str, points: np.ndarray) -> np.ndarray:
    """Returns points (n, 3) after validation."""
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise InvalidArgumentError(argument, points.shape, "a shape (1 or more, 3)")
    if not np.isfinite(points).all():
        wrong = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InvalidArgumentError(f"{argument}[{wrong}]", points[wrong].tolist(), "finite numbers")
    return points
