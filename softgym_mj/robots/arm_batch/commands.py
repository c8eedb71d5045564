"""Commanded points of one environment: `CommandFilter` and the reach of arms as functions."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from softgym_mj.robots.arm import cartesian, command_filter, mounts
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm_batch import inverse_kinematics
from softgym_mj.robots.arm_batch.inverse_kinematics import Kinematics
from softgym_mj.robots.base import SIM_STEP


class Filter(NamedTuple):
    """State of the command filter of n points.

    Attributes:
        commanded: commanded positions (n, 3) [m].
        points: filtered positions (n, 3) [m].
        step: their displacement in the last sim step (n, 3) [m].
    """

    commanded: jax.Array
    points: jax.Array
    step: jax.Array


Draw = Callable[[jax.Array, jax.Array, float], jax.Array]  # As `drawn_in`.


def advance(
    state: Filter, wanted: jax.Array, reference: jax.Array, draw: Draw | None = None
) -> Filter:
    """Runs a sim step.

    Args:
        state: state of the filter.
        wanted: desired commanded points (n, 3) [m].
        reference: points of the reference (n, 3) [m].
        draw: limits the distance of commanded points from the filter, and of the filter from the
            reference; None for `drawn_in`.
    """
    draw = draw or drawn_in
    commanded = draw(wanted, state.points, command_filter.LEAD)
    along = command_filter.ALONG * SIM_STEP
    along = drawn_in(commanded - state.commanded, jnp.zeros_like(commanded), along)
    gap = commanded - along - state.points
    distance, most = _lengths(gap), command_filter.SPEED_UP
    braking = (jnp.sqrt(1.0 + 8.0 * distance / most) - 1.0) / 2.0 * most
    step = gap * (jnp.minimum(braking, distance) / jnp.maximum(distance, 1e-12))
    points = state.points + drawn_in(along + step, state.step, most)
    points = draw(points, reference, cartesian.LEAD)
    return Filter(commanded, points, points - state.points)


def within_reach(arm: Arm, arms: Kinematics, points: jax.Array, limits: jax.Array) -> jax.Array:
    """Returns points (arms, 3) [m], moved into the workspace and the arms' reach.

    Args:
        arm: kind of arm.
        arms: the arms.
        points: points (arms, 3) [m].
        limits: lowest and highest point of the workspace (2, 3) [m].
    """
    local = inverse_kinematics.to_mounts(arms, jnp.clip(points, limits[0], limits[1]))
    forward, left, height = jnp.maximum(local[:, 0], mounts.FORWARD), local[:, 1], local[:, 2]
    distance = jnp.sqrt(forward**2 + left**2)
    scale = jnp.minimum(jnp.maximum(distance, arm.reach[0]), _farthest(arm, height)) / distance
    return inverse_kinematics.to_world(
        arms, jnp.stack([scale * forward, scale * left, height], axis=1)
    )


def at_end(arm: Arm, arms: Kinematics, points: jax.Array) -> jax.Array:
    """Returns which points (arms, 3) [m] are at the end of the arms' reach (arms,) bool."""
    forward, left, height = inverse_kinematics.to_mounts(arms, points).T
    distance = jnp.sqrt(forward**2 + left**2)
    near = (forward < mounts.FORWARD + mounts.END) | (distance < arm.reach[0] + mounts.END)
    return near | (distance > _farthest(arm, height) - mounts.END)


def _farthest(arm: Arm, height: jax.Array) -> jax.Array:
    """Returns `Mount.farthest` at heights (arms,) [m] above the mounts."""
    inner, outer = arm.reach
    return jnp.sqrt(jnp.maximum(outer**2 - (height - mounts.MIDDLE) ** 2, inner**2))


def drawn_in(points: jax.Array, centers: jax.Array, radius: float) -> jax.Array:
    """Returns points (n, 3), moved straight to within `radius` of their `centers` (n, 3)."""
    offset = points - centers
    return centers + offset * (radius / jnp.maximum(_lengths(offset), radius))


def _lengths(vectors: jax.Array) -> jax.Array:
    return jnp.sqrt((vectors**2).sum(-1, keepdims=True))
