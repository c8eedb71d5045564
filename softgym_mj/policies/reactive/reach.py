"""Reach of arms near the floor, for reactive experts."""

from softgym_mj.metrics import Array, constant, lengths, namespace
from softgym_mj.robots.arm.models import FRANKA

# [m] Distance of the bases, at -Y and +Y, from the middle, the same for all arms; least and largest
# horizontal distance from its base at which a Franka, the shortest arm, holds something flat.
BASE, INNER, OUTER = FRANKA.distance, 0.285, 0.765


def base(i: int, like: Array) -> Array:
    """Returns the horizontal position (2,) [m] of the base of arm `i`, as an array like another."""
    return constant([0.0, BASE * (2 * i - 1)], like)


def in_reach(i: int, point: Array) -> Array:
    """Returns whether arm `i` reaches a point (..., 3) [m] near the floor (...)."""
    distance = lengths(point[..., :2] - base(i, point))
    return (distance >= INNER) & (distance <= OUTER)


def way_into_reach(i: int, point: Array, direction: Array) -> Array:
    """Returns how far (...) [m] from a point along a direction the reach of arm `i` begins.

    Where the line misses the reach it is the way to the point of the line nearest to the reach.

    Args:
        i: number of the arm.
        point: (..., 3) [m].
        direction: horizontal unit vector (..., 2).
    """
    xp = namespace(point)
    away = point[..., :2] - base(i, point)
    distance, along = lengths(away), xp.sum(away * direction, axis=-1)
    inner, outer = (
        xp.sqrt(xp.clip(along**2 - distance**2 + radius**2, 0.0, None)) for radius in (INNER, OUTER)
    )
    way = xp.where(distance > OUTER, -outer - along, xp.zeros_like(along))
    return xp.clip(xp.where(distance < INNER, inner - along, way), 0.0, None)
