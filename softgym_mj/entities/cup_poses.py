"""Poses (x [m], z [m], theta [rad]) of cups, and their outlines in the x-z plane.

Functions of arrays of NumPy or PyTorch, of one cup or of a batch.
"""

import math
from collections.abc import Sequence

import numpy as np
from array_api_compat import is_torch_array

from softgym_mj.metrics import Array, columns, constant, namespace

Numbers = Sequence[Sequence[float]]

# Corners of a rectangle, counter-clockwise: their sides along x, which are at the rim, and their
# ends along z.
_SIDES = np.array([-1.0, 1.0, 1.0, -1.0])
_RIM = np.array([0.0, 0.0, 1.0, 1.0])
_ENDS = np.array([-1.0, -1.0, 1.0, 1.0])


def cosine_sine(theta: Array) -> tuple[Array, Array]:
    """Returns cosine and sine of angles (...) [rad]; NumPy's by `math`, machine-independent."""
    if is_torch_array(theta):
        xp = namespace(theta)
        return xp.cos(theta), xp.sin(theta)
    if np.ndim(theta) == 0:  # Four times as fast for one cup.
        return np.array(math.cos(theta)), np.array(math.sin(theta))
    flat = np.ravel(theta).tolist()
    found = (np.array([f(angle) for angle in flat]) for f in (math.cos, math.sin))
    cosine, sine = (values.reshape(np.shape(theta)) for values in found)
    return cosine, sine


def whole_pose(pose: Array) -> Array:
    """Returns position [m], quaternion (w, x, y, z) and theta [rad] of poses (..., 3): (..., 8).

    Theta is that of the quaternion, as in `Cup.pose`.
    """
    xp = namespace(pose)
    cosine, sine = cosine_sine(pose[..., 2] / 2)
    if is_torch_array(pose):
        theta = 2.0 * xp.atan2(sine, cosine)
    else:
        pairs = zip(np.ravel(sine).tolist(), np.ravel(cosine).tolist(), strict=True)
        theta = np.array([2.0 * math.atan2(s, c) for s, c in pairs]).reshape(np.shape(sine))
    none = xp.zeros_like(cosine)
    return xp.stack([pose[..., 0], none, pose[..., 1], cosine, none, sine, none, theta], axis=-1)


def outline(size: Array, pose: Array) -> Array:
    """Returns corners (..., 4, 2) [m] of the outer walls in the x-z plane, counter-clockwise.

    Args:
        size: (..., 4) inner length, width, height and wall [m].
        pose: (..., 3).
    """
    length, _, height, wall = (size[..., i] for i in range(4))
    return _placed(length / 2 + wall, height, 0.0 * wall, pose)


def corners(size: Array, pose: Array) -> Array:
    """Returns corners (..., 4, 2) [m] in the x-z plane that SoftGym keeps above ground.

    They are half the inner length to both sides, half a wall below the floor's middle and above the
    rim. Arguments are those of `outline`.
    """
    length, _, height, wall = (size[..., i] for i in range(4))
    return _placed(length / 2, height, wall / 2, pose)


def _placed(half: Array, height: Array, sill: Array, pose: Array) -> Array:
    """Returns the corners (..., 4, 2) of a rectangle of a cup's x-z plane in the world.

    Args:
        half: (...) half its extent along the cup's x [m].
        height, sill: (...) it extends from -sill to height + sill along the cup's z [m].
        pose: (..., 3).
    """
    x = half[..., None] * constant(_SIDES, pose)
    z = height[..., None] * constant(_RIM, pose) + sill[..., None] * constant(_ENDS, pose)
    cosine, sine = (values[..., None] for values in cosine_sine(pose[..., 2]))
    return columns(x * cosine + z * sine + pose[..., :1], z * cosine - x * sine + pose[..., 1:2])


def overlap(first: Array, second: Array) -> Array:
    """Returns whether (...) two convex polygons (..., n, 2) intersect."""
    xp = namespace(first)
    points = xp.concat([first[..., None, :, :], second[..., None, :, :]], axis=-3)
    edges = xp.concat([points[..., 1:, :], points[..., :1, :]], axis=-2) - points
    edges = xp.reshape(edges, (*first.shape[:-2], 1, 1, -1, 2))
    # Coordinates (..., 2, n, 2n) of the corners along the normals of all edges.
    along = points[..., 1:] * edges[..., 0] - points[..., :1] * edges[..., 1]
    low, high = xp.min(along, axis=-2), xp.max(along, axis=-2)
    apart = (high[..., 0, :] < low[..., 1, :]) | (high[..., 1, :] < low[..., 0, :])
    return ~xp.any(apart, axis=-1)


def is_clear(lowest: float, cup: Numbers, other: Numbers) -> bool:
    """Returns whether a cup is above a height and does not intersect another one.

    The answer is that of `corners`, `outline` and `overlap` for one cup; numbers take a fifth of
    the time of small arrays.

    Args:
        lowest: smallest height of the corners [m].
        cup, other: size, as in `outline`, and pose of each.
    """
    (length, _, height, wall), pose = cup
    if min(z for _, z in _points(length / 2, wall / 2, height, pose)) < lowest:
        return False
    polygons = [_points(size[0] / 2 + size[3], 0.0, size[2], pose) for size, pose in (cup, other)]
    for polygon in polygons:
        for (x0, z0), (x1, z1) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            dx, dz = x1 - x0, z1 - z0
            first, second = ([z * dx - x * dz for x, z in points] for points in polygons)
            if max(first) < min(second) or max(second) < min(first):
                return True
    return False


def _points(
    half: float, sill: float, height: float, pose: Sequence[float]
) -> list[tuple[float, float]]:
    """Returns the corners of `_placed` of one cup."""
    x, z, theta = pose
    cosine, sine, top = math.cos(theta), math.sin(theta), height + sill
    around = ((-half, -sill), (half, -sill), (half, top), (-half, top))
    return [(a * cosine + b * sine + x, b * cosine - a * sine + z) for a, b in around]
