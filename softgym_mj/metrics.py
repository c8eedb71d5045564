"""Measures of states: functions of arrays, of one simulation or of a batch.

Leading dimensions `...` are () for one simulation and (num_envs,) for a batch. Arrays are NumPy's
or PyTorch's; a batch pads different sizes with zeros (`Episode.stack`).
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Mapping
from typing import Any

import array_api_compat
import numpy as np
from scipy.optimize import linear_sum_assignment

from softgym_mj.batch import measures
from softgym_mj.native.arithmetic import interpolate

Array = Any  # Array of NumPy or PyTorch.

# Scan lines for the covered area. With 256 the error on crumpled meshes is 0.03 %; an outline step
# parallel to X costs up to half a line pitch of its length.
AREA_LINES = 256
DISPLACEMENT_WEIGHT = 1.2  # docs/softgym.md 3.7.


@dataclasses.dataclass(frozen=True)
class Measures:
    """Evaluation of an env step, for reward, info and logs.

    Attributes:
        performance: (...) SoftGym's task metric in its own unit; finite.
        rewards: (...) of each term by name; their sum is the reward.
        info: (...) further task-specific scalars by name.
    """

    performance: Array
    rewards: dict[str, Array]
    info: dict[str, Array] = dataclasses.field(default_factory=dict)

    @property
    def reward(self) -> Array:
        """Sum of the reward's terms."""
        return total(self.rewards)


def total(rewards: Mapping[str, Array]) -> Array:
    """Returns the sum (...) of a reward's terms (...)."""
    # `sum` compensates rounding from Python 3.12 on, for floats and not for arrays.
    return functools.reduce(operator.add, rewards.values(), 0)


def namespace(array: Array) -> Any:
    """Returns the array API of an array; NumPy's is recognized by its type, ten times as fast."""
    return np if isinstance(array, np.ndarray) else array_api_compat.array_namespace(array)


def to_host(array: Any) -> np.ndarray:
    """Returns an array or a tensor (...) on any device as a NumPy array (...)."""
    return np.asarray(array.cpu() if hasattr(array, "cpu") else array)


def constant(values: Any, like: Array) -> Array:
    """Returns numbers (...) as an array of the library and on the device of `like`.

    Copies on a device are cached.
    """
    numbers = np.asarray(values)
    if isinstance(like, np.ndarray | np.generic):
        return numbers
    return _constant(numbers.tobytes(), numbers.shape, numbers.dtype, like.device)


@functools.cache
def _constant(content: bytes, shape: tuple[int, ...], dtype: np.dtype, device: Any) -> Array:
    import torch

    numbers = np.frombuffer(content, dtype).reshape(shape)
    return torch.from_numpy(numbers.copy()).to(device)


def chosen(points: Array, indices: Any) -> Array:
    """Returns points (..., k, 3) out of points (..., n, 3) by common indices (k,)."""
    return namespace(points).take(points, constant(indices, points), axis=-2)


def normalize(performance: Array, lower: Array, upper: Array) -> Array:
    """Returns (s - lower) / (upper - lower), or 0 if the bounds coincide (docs/softgym.md 1.8)."""
    span = upper - lower
    return (performance - lower) / (span + (span == 0)) * (span != 0)


def flat(values: Array) -> Array:
    """Returns values (..., rows, columns) as (..., rows * columns)."""
    return values.reshape((*values.shape[:-2], math.prod(values.shape[-2:])))


def mean(values: Array, counts: Array) -> Array:
    """Returns means (...) over the last axis of values (..., n) with weights (..., n) of 0 or 1."""
    xp = namespace(values)
    return xp.sum(values * counts, axis=-1) / xp.sum(counts, axis=-1)


def distance(first: Array, second: Array) -> Array:
    """Returns distances (...) [m] of points (..., 3), rounded as by `math.dist` for NumPy."""
    if array_api_compat.is_torch_array(first):
        return namespace(first).linalg.vector_norm(first - second, axis=-1)
    rows = zip(first.reshape(-1, 3).tolist(), second.reshape(-1, 3).tolist(), strict=True)
    return np.array([math.dist(a, b) for a, b in rows]).reshape(first.shape[:-1])[()]


def lengths(vectors: Array) -> Array:
    """Returns lengths (...) of vectors (..., n), of up to 7 entries."""
    if not isinstance(vectors, np.ndarray):
        return namespace(vectors).linalg.vector_norm(vectors, axis=-1)
    first, *others = (vectors[..., k] for k in range(vectors.shape[-1]))
    return np.sqrt(sum((x * x for x in others), first * first))  # Bits of `vector_norm`, faster.


def columns(*values: Array) -> Array:
    """Returns values (...) stacked along a new last axis (..., n), faster than by `stack`."""
    return namespace(values[0]).concat([value[..., None] for value in values], axis=-1)


def taken(points: Array, indices: Array) -> Array:
    """Returns points (..., k, 3) out of points (..., n, 3) by their indices (..., k)."""
    xp = namespace(points)
    if indices.ndim == 1:  # Ten times as fast for one simulation.
        return points.take(indices, axis=-2) if xp is np else points[indices]
    return xp.take_along_axis(points, indices[..., None], axis=-2)


def covered_area(vertices: Array, triangles: Array, lines: int = AREA_LINES) -> Array:
    """Returns areas (...) [m^2] that triangle meshes cover in top view; layers count once.

    The covered length is exact along X on each of `lines` equidistant lines of constant Y, and
    integrated along Y by the midpoint rule. The result depends neither on the mesh resolution nor
    on the orientation; for an axis-aligned flat cloth it equals SoftGym's (docs/softgym.md 3.6).

    Args:
        vertices: (..., n, 3) or (..., n, 2) positions [m].
        triangles: (..., m, 3) vertex indices.
        lines: number of lines.
    """
    if array_api_compat.is_torch_array(vertices):
        return _covered_areas(vertices, triangles, lines)
    if vertices.ndim == 2:
        return _covered_area(vertices, triangles, lines)
    return np.array([covered_area(v, t, lines) for v, t in zip(vertices, triangles, strict=True)])


def _covered_area(vertices: np.ndarray, triangles: np.ndarray, lines: int) -> float:
    y = vertices[:, 1].take(triangles)
    bottom, top = y.min(), y.max()
    pitch = (top - bottom) / lines
    if pitch <= 0.0:
        return 0.0
    return float(np.sum(measures.covered_parts(vertices, triangles, lines, bottom, pitch)) * pitch)


def _covered_areas(vertices: Array, triangles: Array, lines: int) -> Array:
    """Computes `covered_area` of PyTorch's tensors."""
    points = vertices.double().reshape((-1, *vertices.shape[-2:]))
    corners = triangles.long().reshape((-1, *triangles.shape[-2:]))
    return measures.covered_areas(points, corners, lines).reshape(vertices.shape[:-2])


def particles(shape: Mapping[str, Array], points: Array) -> Array:
    """Returns positions (..., dimy, dimx, 3) [m] of SoftGym's particles on a cloth.

    Args:
        shape: arrays of the cloth, `Cloth.arrays`.
        points: (..., n, 3) positions of its vertices [m].
    """
    xp = namespace(points)
    sheet = taken(points, flat(shape["grid"])).reshape((*shape["grid"].shape, 3))
    if xp is np and points.ndim == 2:  # Faster than sums, and most with x, y and z apart.
        planes = np.ascontiguousarray(np.moveaxis(sheet, -1, 0))
        planes = interpolate(shape["by_row"], interpolate(shape["by_column"], planes, 2), 1)
        return np.moveaxis(planes, 0, -1)
    across = xp.einsum("...ic,...rck->...rik", shape["by_column"], sheet)
    return xp.einsum("...jr,...rik->...jik", shape["by_row"], across)


def particle_counts(shape: Mapping[str, Array]) -> Array:
    """Returns 1 for each of SoftGym's particles of a cloth, 0 for padding (..., n)."""
    return flat(shape["rows"][..., :, None] * shape["columns"][..., None, :])


def goal_distance(shape: Mapping[str, Array], points: Array, goal: Array) -> Array:
    """Returns the mean distance (...) [m] of a cloth's particles from their goal positions.

    Args:
        shape, points: as in `particles`.
        goal: (..., dimy, dimx, 3) [m].
    """
    away = lengths(particles(shape, points) - goal)
    return mean(flat(away), particle_counts(shape))


def fold(shape: Mapping[str, Array], points: Array, goal: Array) -> Measures:
    """Measures how well columns 0 to half of a cloth lie on their mirror columns, at their goals.

    Everything is measured at SoftGym's particles, so it does not depend on the resolution. The
    middle column of an odd number belongs to neither half.

    Args:
        shape, points: as in `particles`.
        goal: (..., dimy, dimx, 3) [m] particles of the unfolded cloth; the second half counts.

    Returns:
        Measures; rewards: minus the mean distance of the pairs, and minus 1.2 times the mean
        displacement [m].
    """
    sheet = particles(shape, points)
    mirror = _columns(sheet, shape["second_half"])
    counts = flat(shape["rows"][..., :, None] * shape["pairs"][..., None, :])
    pair = mean(flat(lengths(_columns(sheet, shape["first_half"]) - mirror)), counts)
    moved = mean(flat(lengths(mirror - _columns(goal, shape["second_half"]))), counts)
    rewards = {"pair_distance": -pair, "displacement": -DISPLACEMENT_WEIGHT * moved}
    return Measures(total(rewards), rewards, info={"pair_distance": pair, "displacement": moved})


def _columns(sheet: Array, indices: Array) -> Array:
    """Returns columns (..., rows, k, 3) of a sheet (..., rows, columns, 3) by indices (..., k)."""
    xp = namespace(sheet)
    if indices.ndim == 1:
        if xp is np:  # As in `particles`.
            return np.moveaxis(np.moveaxis(sheet, -1, 0).take(indices, axis=2), 0, -1)
        return sheet[:, indices]
    return xp.take_along_axis(sheet, indices[..., None, :, None], axis=-2)


def inside(points: Array, pose: Array, size: Array) -> Array:
    """Returns which points are in a cup's box, rotated with it: (..., n) bool.

    The box includes the walls, and half a wall above the rim (docs/softgym.md 3.0).

    Args:
        points: (..., n, 3) [m] in the world.
        pose: (..., 7) of the cup, or longer: x, y, z [m], quaternion (w, x, y, z).
        size: (..., 4) its inner length, width, height and wall [m].
    """
    away = [points[..., i] - pose[..., None, i] for i in range(3)]
    single = isinstance(pose, np.ndarray) and pose.ndim == 1  # Numbers are faster than arrays.
    (_, _, _, w, x, y, z, *_), (length, width, height, wall) = (
        each.tolist() if single else [each[..., i, None] for i in range(each.shape[-1])]
        for each in (pose, size)
    )
    axes = (  # Axes of the cup in the world.
        (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z),
    )
    along, across, above = (
        away[0] * axis[0] + away[1] * axis[1] + away[2] * axis[2] for axis in axes
    )
    return (
        (abs(along) <= length / 2 + wall)
        & (abs(across) <= width / 2 + wall)
        & (above >= -wall / 2)
        & (above <= height + wall / 2)
    )


def fraction(marks: Array, present: Array) -> Array:
    """Returns the share (...) of marked points among those present; both are (..., n) bool."""
    xp = namespace(marks)
    if xp is np:  # Whole numbers are counted faster than added.
        return np.count_nonzero(marks & present, axis=-1) / np.count_nonzero(present, axis=-1)
    return mean(xp.astype(marks, xp.float64), xp.astype(present, xp.float64))


def highest(points: Array, present: Array) -> Array:
    """Returns the largest height (...) [m] among the present points (..., n, 3)."""
    xp = namespace(points)
    return xp.max(xp.where(present, points[..., 2], -math.inf), axis=-1)


def matched_distance(points: Array, goal: Array) -> Array:
    """Returns the mean distance (...) [m] of points (..., n, 3) to goal points (..., n, 3).

    Pairs minimize the total distance (linear assignment; Jonker and Volgenant, 1987).
    """
    apart = lengths(points[..., :, None, :] - goal[..., None, :, :])
    matrices, leading = apart.reshape((-1, *apart.shape[-2:])), apart.shape[:-2]
    if array_api_compat.is_torch_array(points):
        return measures.matched_distances(matrices.double()).reshape(leading)
    found = [np.mean(matrix[linear_sum_assignment(matrix)]) for matrix in matrices]
    return np.array(found).reshape(leading)[()]
