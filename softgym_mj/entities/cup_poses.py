"""Poses (x [m], z [m], theta [rad]) of cups, and their outlines in the x-z plane.

Functions of arrays of NumPy or PyTorch, of one cup or of a batch.
"""

import math

import numpy as np
from array_api_compat import device, is_torch_array

from softgym_mj.metrics import Array, namespace
from softgym_mj.native.arithmetic import product


def cosine_sine(theta: Array) -> tuple[Array, Array]:
    """Returns cosine and sine of angles (...) [rad]; NumPy's by `math`, machine-independent."""
    if is_torch_array(theta):
        xp = namespace(theta)
        return xp.cos(theta), xp.sin(theta)
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
    half, none = length / 2 + wall, 0.0 * height
    return _placed([[-half, none], [half, none], [half, height], [-half, height]], pose)


def corners(size: Array, pose: Array) -> Array:
    """Returns corners (..., 4, 2) [m] in the x-z plane that SoftGym keeps above ground.

    They are half the inner length to both sides, half a wall below the floor's middle and above the
    rim. Arguments are those of `outline`.
    """
    length, _, height, wall = (size[..., i] for i in range(4))
    half, sill = length / 2, wall / 2
    top = height + sill
    return _placed([[-half, -sill], [half, -sill], [half, top], [-half, top]], pose)


def _placed(points: list[list[Array]], pose: Array) -> Array:
    """Returns points (..., n, 2) of the cup's x-z plane in world coordinates."""
    xp = namespace(pose)
    places = xp.stack([xp.stack(point, axis=-1) for point in points], axis=-2)
    cosine, sine = cosine_sine(pose[..., 2])
    rows = xp.stack([cosine, -sine], axis=-1), xp.stack([sine, cosine], axis=-1)
    return product(places, xp.stack(rows, axis=-2)) + pose[..., None, :2]


def overlap(first: Array, second: Array) -> Array:
    """Returns whether (...) two convex polygons (..., n, 2) and (..., m, 2) intersect."""
    xp = namespace(first)
    apart = xp.zeros(first.shape[:-2], dtype=xp.bool, device=device(first))
    for polygon in (first, second):
        edges = xp.roll(polygon, -1, axis=-2) - polygon
        normals = xp.stack([-edges[..., 1], edges[..., 0]], axis=-2)
        a, b = product(first, normals), product(second, normals)
        beside = (xp.max(a, axis=-2) < xp.min(b, axis=-2)) | (
            xp.max(b, axis=-2) < xp.min(a, axis=-2)
        )
        apart = apart | xp.any(beside, axis=-1)
    return ~apart
