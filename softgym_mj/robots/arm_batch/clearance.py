"""Distances of an arm's shapes from the floor and from those of another arm.

A capsule, sphere or box is a core box (a segment or a point in the limit) with a radius; a cylinder
is its own core. Alternating projections onto two cores converge to their nearest points. They start
from the nearest points of the cores' segments along z, which are exact for capsules.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm_batch.chain import Pose, apply, product

PROJECTIONS = 20  # Number of alternating projections onto two cores.
KINDS = mujoco.mjtGeom


class Shapes(NamedTuple):
    """Shapes on an arm's bodies.

    Attributes:
        body: body of each shape (k,).
        position, rotation: pose in the body (k, 3) [m], (k, 3, 3).
        core: half sizes of the core (k, 3) [m].
        radius: radius around the core (k,) [m].
        is_round: whether the core is a cylinder along z, with the radius core[0] (k,).
    """

    body: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    core: np.ndarray
    radius: np.ndarray
    is_round: np.ndarray


class Ends(NamedTuple):
    """Nearest points of pairs of shapes.

    Attributes:
        first, second: points on the surfaces (..., 3) [m].
        normal: direction from the first to the second (..., 3).
        distance: distance [m] (...); of the cores less the radii if shapes overlap.
    """

    first: jax.Array
    second: jax.Array
    normal: jax.Array
    distance: jax.Array


def shapes_of(model: mujoco.MjModel, geoms: list[int]) -> Shapes:
    """Returns the shapes of some geoms of a model: spheres, capsules, boxes and cylinders."""
    core, radius = np.zeros((len(geoms), 3)), np.zeros(len(geoms))
    kinds = model.geom_type[geoms]
    for i, (geom, kind) in enumerate(zip(geoms, kinds, strict=True)):
        size = model.geom_size[geom]
        if kind == KINDS.mjGEOM_CAPSULE:
            core[i, 2], radius[i] = size[1], size[0]
        elif kind == KINDS.mjGEOM_SPHERE:
            radius[i] = size[0]
        elif kind == KINDS.mjGEOM_CYLINDER:
            core[i] = size[0], size[0], size[1]
        else:
            assert kind == KINDS.mjGEOM_BOX, "a shape without distances"
            core[i] = size
    return Shapes(
        body=model.geom_bodyid[geoms],
        position=model.geom_pos[geoms],
        rotation=turns.matrices(model.geom_quat[geoms]),
        core=core,
        radius=radius,
        is_round=kinds == KINDS.mjGEOM_CYLINDER,
    )


def placed(shapes: Shapes, pose: Pose) -> tuple[jax.Array, jax.Array]:
    """Returns positions [m] (k, 3) and rotations (k, 3, 3) of shapes in the mount's frame."""
    frame = pose.rotation[shapes.body]
    position = pose.position[shapes.body] + apply(frame, shapes.position)
    return position, product(frame, shapes.rotation)


def lowest(shapes: Shapes, position: jax.Array, rotation: jax.Array) -> jax.Array:
    """Returns the lowest point of each shape [m] (k, 3)."""
    down = -rotation[:, 2]
    side = jnp.where(down > 0.0, 1.0, -1.0)
    across = down[:, :2] / jnp.maximum(jnp.linalg.norm(down[:, :2], axis=1), 1e-15)[:, None]
    rim = jnp.where(shapes.is_round[:, None], across, side[:, :2])
    corner = jnp.concatenate([rim, side[:, 2:]], axis=1) * shapes.core
    below = jnp.array([0.0, 0.0, -1.0]) * shapes.radius[:, None]
    return position + apply(rotation, corner) + below


def nearest(
    first: Shapes,
    first_pose: tuple[jax.Array, jax.Array],
    second: Shapes,
    second_pose: tuple[jax.Array, jax.Array],
) -> Ends:
    """Returns the nearest points of all pairs (k1, k2) of shapes of two arms.

    Args:
        first, second: shapes.
        first_pose, second_pose: their positions and rotations in a common frame.
    """
    own = first_pose[0][:, None], first_pose[1][:, None], first.core[:, None]
    one = _Core(*own, first.is_round[:, None, None])
    other = _Core(*second_pose, second.core, second.is_round[:, None])
    start, end = _between(one, other)
    # Nearest points of two segments are exact already.
    i, j = np.nonzero(_are_thick(first)[:, None] | _are_thick(second))
    one = _Core(*(each[i] for each in (*first_pose, first.core, first.is_round[:, None])))
    other = _Core(*(each[j] for each in (*second_pose, second.core, second.is_round[:, None])))

    def project(_, ends):
        begin = one.nearest(ends[1])
        return begin, other.nearest(begin)

    ends = jax.lax.fori_loop(0, PROJECTIONS, project, (start[i, j], end[i, j]))
    start, end = start.at[i, j].set(ends[0]), end.at[i, j].set(ends[1])
    gap = end - start
    distance = jnp.sqrt((gap**2).sum(-1))
    normal = gap / jnp.maximum(distance, 1e-12)[..., None]
    return Ends(
        start + first.radius[:, None, None] * normal,
        end - second.radius[:, None] * normal,
        normal,
        distance - first.radius[:, None] - second.radius,
    )


def _are_thick(shapes: Shapes) -> np.ndarray:
    """Returns which cores (k,) are no segments; all, if they are not constants."""
    core = shapes.core
    return core[:, :2].max(1) > 0.0 if isinstance(core, np.ndarray) else np.ones(len(core), bool)


class _Core(NamedTuple):
    position: jax.Array
    rotation: jax.Array
    size: np.ndarray
    is_round: np.ndarray

    def nearest(self, points: jax.Array) -> jax.Array:
        """Returns the points (..., 3) of the core that are nearest to others (..., 3)."""
        local = apply(jnp.swapaxes(self.rotation, -1, -2), points - self.position)
        boxed = jnp.clip(local, -self.size, self.size)
        far = jnp.sqrt((local[..., :2] ** 2).sum(-1, keepdims=True))
        most = self.size[..., :1]
        disk = local[..., :2] * (most / jnp.maximum(far, jnp.maximum(most, 1e-12)))
        flat = jnp.where(self.is_round, disk, boxed[..., :2])
        return self.position + apply(
            self.rotation, jnp.concatenate([flat, boxed[..., 2:]], axis=-1)
        )


def _between(one: _Core, other: _Core) -> tuple[jax.Array, jax.Array]:
    """Returns nearest points (..., 3) of the segments along the z axes of pairs of cores.

    Parallel segments have several such pairs. (Ericson, Real-Time Collision Detection, 5.1.9.)
    """
    a, b = (core.rotation[..., 2] * core.size[..., 2:] for core in (one, other))
    gap = other.position - one.position
    long, wide, across = (a * a).sum(-1), (b * b).sum(-1), -(a * b).sum(-1)
    u, v = (a * gap).sum(-1), -(b * gap).sum(-1)
    determinant = long * wide - across**2
    least = jnp.finfo(gap.dtype).tiny
    x = jnp.clip((wide * u - across * v) / jnp.maximum(determinant, least), -1.0, 1.0)
    y = jnp.clip((v - across * x) / jnp.maximum(wide, least), -1.0, 1.0)
    x = jnp.clip((u - across * y) / jnp.maximum(long, least), -1.0, 1.0)
    return one.position + x[..., None] * a, other.position + y[..., None] * b
