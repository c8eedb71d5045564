"""Contact points of a box on a cap of a cylinder, such as a finger's pad on a peg."""

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm_batch.boxes import CORNERS, Manifold, Solid
from softgym_mj.robots.arm_batch.chain import apply

# Cosine of the angle below which a face and a cap touch at several points, as in MuJoCo 3.17
# (measured).
ALIGNED = 0.996


def box_cap(box: Solid, cylinder: Solid) -> Manifold:
    """Returns up to four points at which a face of a box overlaps a cap of a cylinder.

    They are the points of the face over the cap that are farthest along the face's diagonals. As in
    MuJoCo, the normal is the face's, and distances lead along it from the points' projections onto
    the cap. Nothing touches if face and cap are not parallel, or if the shortest way out of the
    cylinder leads through its side.

    Args:
        box: as in `boxes`.
        cylinder: one along its z axis; its sizes are (radius, radius, half length).
    """
    origin, frame, size = box
    radius, length = cylinder[2][0], cylinder[2][2]
    axis, middle = apply(frame.T, cylinder[1][:, 2]), apply(frame.T, cylinder[0] - origin)
    face = jnp.argmax(jnp.abs(axis))
    order = (face + jnp.array([1, 2, 0])) % 3  # The face's normal becomes the last axis.
    axis, middle, size = axis[order], middle[order], size[order]
    side = jnp.where(middle[2] >= 0.0, 1.0, -1.0)
    upward = axis * jnp.where(axis[2] * side > 0.0, -1.0, 1.0)  # From the cap toward the box.
    cap, height = middle + length * upward, side * size[2]
    center = (cap + (height - cap[2]) / upward[2] * upward)[:2]

    cosine = jnp.abs(axis[2])
    sine = jnp.sqrt(jnp.maximum(1.0 - cosine**2, 0.0))
    through_cap = jnp.minimum(
        size[2] + length * cosine + radius * sine - jnp.abs(middle[2]),
        length + (jnp.abs(axis) * size).sum() - jnp.abs((axis * middle).sum()),
    )
    beyond = jnp.abs(center) - size[:2]
    outside = jnp.sqrt((jnp.maximum(beyond, 0.0) ** 2).sum())
    through_side = radius - outside - jnp.minimum(beyond.max(), 0.0)

    flat, exist = _common(size[:2], center, radius)
    points = jnp.column_stack([flat, jnp.full(len(flat), height)])
    heights = ((points - cap) * upward).sum(-1)
    exist &= heights < 0.0
    reach = jnp.where(exist, (CORNERS[:, None] * flat).sum(-1), -jnp.inf)
    chosen = jnp.argmax(reach, axis=1)
    is_first = ~jnp.tril(chosen[:, None] == chosen, -1).any(1)
    touches = exist[chosen] & is_first & (cosine > ALIGNED) & (through_cap < through_side)

    normal = side * (np.arange(3) == 2)
    distance = cosine * heights[chosen]
    points = points[chosen] - heights[chosen, None] * upward - 0.5 * distance[:, None] * normal
    back = jnp.argsort(order)
    return Manifold(
        origin + apply(frame, points[:, back]),
        jnp.tile(apply(frame, normal[back]), (len(points), 1)),
        jnp.where(touches, distance, jnp.inf),
    )


def _common(size: jax.Array, center: jax.Array, radius: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Returns possible outer points (16, 2) of a rectangle on a disk, and which exist.

    Args:
        size: half sizes of the rectangle (2,), which has its center at 0.
        center, radius: the disk's (2,), ().
    """
    corners, bulges = CORNERS * size, center + radius / np.sqrt(2.0) * CORNERS
    # Crossings of the circle with the rectangle's sides, two with each of x = side and y = side.
    sides = jnp.array([[-1.0], [1.0]]) * size
    squares = radius**2 - (sides - center) ** 2
    half = jnp.sqrt(jnp.maximum(squares, 0.0))
    ends = center[::-1] + jnp.stack([-half, half])
    crosses = (squares > 0.0) & (jnp.abs(ends) <= size[::-1])
    sides = jnp.broadcast_to(sides, ends.shape)
    of_x, of_y = jnp.stack([sides, ends], -1)[..., 0, :], jnp.stack([ends, sides], -1)[..., 1, :]
    points = jnp.concatenate([corners, bulges, of_x.reshape(4, 2), of_y.reshape(4, 2)])
    covered = ((corners - center) ** 2).sum(-1) <= radius**2
    inside = (jnp.abs(bulges) <= size).all(-1)
    exist = [covered, inside, crosses[..., 0].ravel(), crosses[..., 1].ravel()]
    return points, jnp.concatenate(exist)
