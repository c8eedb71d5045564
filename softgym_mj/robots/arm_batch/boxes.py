"""Contact points of a box with a box or a capsule, as MuJoCo's `mjc_BoxBox` and `mjc_CapsuleBox`.

Functions are for one pair; `jax.vmap` adds axes. Solids are (position (3,) [m], rotation (3, 3),
half sizes (3,) [m]); a capsule's sizes are its radius and half the length of its segment.
"""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm_batch.chain import apply, product

POINTS = 8  # Corners of the intersection of two rectangles.
CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])  # Of a rectangle, in turn.
# Preference of faces over edges as normals, as in MuJoCo: cosine of an angle below which they are
# the same, and the fraction of the depth by which edges must then be less deep.
SAME, SHALLOWER = 0.99, 0.05
PARALLEL = 1e-16  # Squared sine of an angle below which edges have no common normal.

Solid: TypeAlias = tuple[jax.Array, jax.Array, jax.Array]


class Manifold(NamedTuple):
    """Contact points of a pair.

    Attributes:
        points: points midway between the surfaces (n, 3) [m].
        normal: direction from the first to the second (n, 3).
        distance: distances of the surfaces (n,) [m], negative if they overlap; infinite for places
            of the array without a point.
    """

    points: jax.Array
    normal: jax.Array
    distance: jax.Array


def box_box(first: Solid, second: Solid) -> Manifold:
    """Returns up to `POINTS` points at which two boxes overlap.

    They have a common normal, the axis on which the boxes overlap least: of a face, on which the
    nearest face of the other box is clipped, or of two edges, which have one point.
    """
    origin, frame, size = first
    turn = product(frame.T, second[1])  # From the second box's axes to the first's.
    offset = apply(frame.T, second[0] - origin)
    crossed = jnp.cross(jnp.eye(3)[:, None], turn.T).reshape(9, 3)
    squares = (crossed**2).sum(-1)
    axes = crossed / jnp.sqrt(jnp.maximum(squares, PARALLEL))[:, None]
    axes = jnp.concatenate([jnp.eye(3), turn.T, axes])
    reach = apply(jnp.abs(axes), size) + apply(jnp.abs(apply(turn.T, axes)), second[2])
    gaps = jnp.abs(apply(axes, offset)) - reach
    gaps = gaps.at[6:].set(jnp.where(squares < PARALLEL, -jnp.inf, gaps[6:]))
    face, edge = jnp.argmax(gaps[:6]), 6 + jnp.argmax(gaps[6:])
    same = jnp.abs((axes[face] * axes[edge]).sum()) > SAME
    need = gaps[face] + jnp.where(same, SHALLOWER * jnp.abs(gaps[face]), 0.0)
    local = jax.tree.map(
        lambda edges, faces: jnp.where(gaps[edge] > need, edges, faces),
        _edges(axes[edge], edge - 6, size, second[2], turn, offset, gaps[edge]),
        _faces(face, size, second[2], turn, offset),
    )
    distance = jnp.where((gaps < 0.0).all(), local.distance, jnp.inf)
    distance = jnp.where(distance < 0.0, distance, jnp.inf)
    return Manifold(origin + apply(frame, local.points), apply(frame, local.normal), distance)


def _edges(
    axis: jax.Array, pair: jax.Array, size: jax.Array, other: jax.Array, turn: jax.Array,
    offset: jax.Array, gap: jax.Array,
) -> Manifold:  # fmt: skip
    """Returns the contact of edges `pair // 3` and `pair % 3` with a normal, in the first axes."""
    axis = axis * jnp.where((axis * offset).sum() < 0.0, -1.0, 1.0)
    own, along = (jnp.arange(3) == i for i in (pair // 3, pair % 3))
    start = jnp.where(own, 0.0, jnp.where(axis >= 0.0, size, -size))
    corner = jnp.where(along, 0.0, jnp.where(apply(turn.T, axis) >= 0.0, -other, other))
    end = offset + apply(turn, corner)
    one, two = own * 1.0, (turn * along).sum(1)
    # Nearest points of two lines with unit directions.
    way, cosine = end - start, (one * two).sum()
    a, b = (way * one).sum(), (way * two).sum()
    sine = jnp.maximum(1.0 - cosine**2, 1e-15)
    begin = start + (a - cosine * b) / sine * one
    finish = end + (cosine * a - b) / sine * two
    points = jnp.tile(0.5 * (begin + finish), (POINTS, 1))
    return Manifold(
        points, jnp.tile(axis, (POINTS, 1)), jnp.where(np.arange(POINTS) == 0, gap, jnp.inf)
    )


def _faces(
    face: jax.Array, size: jax.Array, other: jax.Array, turn: jax.Array, offset: jax.Array
) -> Manifold:
    """Returns the contact on a face of the first box (0 to 2) or of the second, in its axes."""
    is_first = face < 3
    # The box with the face is the reference; coordinates (x, y, z) have its normal as z.
    turns = jnp.where(is_first, turn, turn.T)
    center = jnp.where(is_first, offset, -apply(turn.T, offset))
    sizes, incident = jnp.where(is_first, size, other), jnp.where(is_first, other, size)
    order = (face % 3 + jnp.array([1, 2, 0])) % 3
    turns, center, sizes = turns[order], center[order], sizes[order]
    sign = jnp.where(center[2] >= 0.0, 1.0, -1.0)
    upward = jnp.array([1.0, 1.0, sign])  # Mirrors the incident box to above the reference.
    turns, center = turns * upward[:, None], center * upward
    normal = jnp.argmax(jnp.abs(turns[2]))
    center -= jnp.where(turns[2, normal] > 0.0, 1.0, -1.0) * incident[normal] * turns[:, normal]
    center = center.at[2].add(-sizes[2])
    sides = [turns[:, (normal + i) % 3] * incident[(normal + i) % 3] for i in (1, 2)]
    corners = center + CORNERS[:, :1] * sides[0] + CORNERS[:, 1:] * sides[1]
    points, exist = _clipped(corners, center, jnp.stack(sides), sizes[:2])
    first = jnp.argsort(~exist, stable=True)[:POINTS]
    points, exist = points[first], exist[first]
    height = points[:, 2]
    middles = jnp.column_stack([points[:, :2], sign * (sizes[2] + 0.5 * height)])
    back = jnp.argsort(order)
    middles, up = middles[:, back], sign * (jnp.arange(3) == face % 3)
    middles = jnp.where(is_first, middles, offset + apply(turn, middles))
    up = jnp.where(is_first, up, -apply(turn, up))
    return Manifold(middles, jnp.tile(up, (POINTS, 1)), jnp.where(exist, height, jnp.inf))


def _clipped(
    corners: jax.Array, center: jax.Array, sides: jax.Array, most: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Returns possible corners (24, 3) of a parallelogram clipped on a rectangle, and which exist.

    Args:
        corners: corners of the parallelogram, in turn (4, 3).
        center: its center (3,).
        sides: half its sides (2, 3).
        most: half sizes of the rectangle (2,), in the plane of x and y.
    """
    # Corners of the rectangle on the parallelogram.
    places = CORNERS * most
    u, v = sides
    area = u[0] * v[1] - u[1] * v[0]
    x, y = (places - center[:2]).T
    shares = jnp.column_stack([x * v[1] - y * v[0], u[0] * y - u[1] * x]) / area
    above = center + shares[:, :1] * u + shares[:, 1:] * v
    covered = (jnp.abs(shares) < 1.0).all(1)
    # Crossings of the parallelogram's sides with the rectangle's.
    ways = jnp.roll(corners, -1, axis=0) - corners
    limits = jnp.stack([most, -most])[:, None]
    way = ways[:, :2]
    fractions = (limits - corners[:, :2]) / jnp.where(way == 0.0, jnp.inf, way)  # (2, 4, 2)
    crossings = corners[:, None] + fractions[..., None] * ways[:, None]
    across = jnp.abs(crossings[..., :2])[..., ::-1]
    across = jnp.stack([across[..., 0, 0], across[..., 1, 1]], axis=-1)
    crosses = (fractions > 0.0) & (fractions < 1.0) & (across <= most[::-1])
    inside = (jnp.abs(corners[:, :2]) <= most).all(1)
    points = jnp.concatenate([corners, crossings.reshape(-1, 3), above])
    return points, jnp.concatenate([inside, crosses.ravel(), covered])


def capsule_box(capsule: Solid, box: Solid) -> Manifold:
    """Returns up to two points at which a capsule and a box overlap.

    The first is at the point of the capsule's segment nearest to the box. The second is where the
    segment, if it lies along a face or an edge of the box, leaves it farther away from the first.
    """
    origin, frame, size = box
    middle, half = apply(frame.T, capsule[0] - origin), capsule[2][1] * frame.T @ capsule[1][:, 2]
    # The squared distance is a convex function of the place on the segment (-1 to 1). Its slope is
    # linear between the places where the segment enters or leaves the slabs of the box.
    ways = jnp.where(jnp.abs(half) < 1e-9, 1e-9, half)
    ends = jnp.sort(jnp.stack([-size - middle, size - middle]) / ways, axis=0)
    places = jnp.sort(jnp.clip(jnp.append(ends, jnp.array([-1.0, 1.0])), -1.0, 1.0))

    def beyond(places):
        points = middle + places[:, None] * half
        return points - jnp.clip(points, -size, size)

    slopes = (beyond(places) * half).sum(-1)
    last = jnp.clip(jnp.searchsorted(slopes, 0.0), 1, len(places) - 1)
    rise = slopes[last] - slopes[last - 1]
    share = jnp.where(rise > 0.0, -slopes[last - 1] / jnp.where(rise > 0.0, rise, 1.0), 0.0)
    share = jnp.clip(share, 0.0, 1.0)
    place = places[last - 1] + share * (places[last] - places[last - 1])
    # Ends of the part of the segment over the face on which it lies, or next to an edge.
    face = jnp.argmax(jnp.abs(middle + place * half) - size)
    others = (jnp.arange(3) != face) & (ends[0] < 1.0) & (ends[1] > -1.0)
    first = jnp.clip(jnp.where(others, ends[0], -1.0).max(), -1.0, 1.0)
    final = jnp.clip(jnp.where(others, ends[1], 1.0).min(), -1.0, 1.0)
    other = jnp.where(place - first > final - place, first, final)
    exists = jnp.array([True, (final > first) & (jnp.abs((other - place) * half).max() > 1e-9)])
    local = jax.vmap(_sphere_box, (0, None, None))(
        middle + jnp.stack([place, other])[:, None] * half, capsule[2][0], size
    )
    distance = jnp.where(exists & (local.distance < 0.0), local.distance, jnp.inf)
    normal = apply(frame, local.normal)
    return Manifold(origin + apply(frame, local.points), normal, distance)


def _sphere_box(center: jax.Array, radius: jax.Array, size: jax.Array) -> Manifold:
    """Returns the contact (without n) of a sphere with a box, in the box's axes."""
    nearest = jnp.clip(center, -size, size)
    way = nearest - center
    outside = jnp.sqrt((way**2).sum())
    # From a center in the box, the way leads out of its nearest face and back.
    depth = size - jnp.abs(center)
    face = jnp.arange(3) == jnp.argmin(depth)
    inward = jnp.where(face, jnp.where(center > 0.0, -1.0, 1.0), 0.0)
    is_inside = outside <= 1e-12
    distance = jnp.where(is_inside, -depth.min(), outside)
    normal = jnp.where(is_inside, inward, way / jnp.maximum(outside, 1e-12))
    points = center + 0.5 * (radius + distance) * normal
    return Manifold(points, normal, distance - radius)
