"""Commanded points of one environment: their filter, and the reach of arms, as functions."""

import jax
import jax.numpy as jnp

from softgym_mj.robots.arm import cartesian, mounts
from softgym_mj.robots.arm.command_filter import Draw, Filter, advanced, drawn_in
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm_batch import inverse_kinematics
from softgym_mj.robots.arm_batch.inverse_kinematics import Kinematics


def advance(
    state: Filter, wanted: jax.Array, reference: jax.Array, draw: Draw = drawn_in
) -> Filter:
    """Runs a sim step.

    Args:
        state: state of the filter.
        wanted: desired commanded points (n, 3) [m].
        reference: points of the reference (n, 3) [m].
        draw: limits the distance of commanded points from the filter, and of the filter from the
            reference.
    """
    return advanced(state, wanted, lambda points: draw(points, reference, cartesian.LEAD), draw)


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
