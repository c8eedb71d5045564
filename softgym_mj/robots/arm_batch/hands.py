"""Solids of hands, which push cloth and rope: their poses, motion and response to impulses."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from softgym_mj.robots.arm import turns
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm_batch import chain as chains
from softgym_mj.robots.arm_batch import models
from softgym_mj.robots.arm_batch.chain import Pose
from softgym_mj.robots.arm_batch.dynamics import Dynamics


class Solids(NamedTuple):
    """Solids of a hand, in the order of the model's geoms.

    Attributes:
        is_pad: whether each solid is a pad (k,).
        body: body of each solid (k,).
        position, rotation: pose in the body (k, 3) [m], (k, 3, 3).
    """

    is_pad: np.ndarray
    body: np.ndarray
    position: np.ndarray
    rotation: np.ndarray


class SolidSteps(NamedTuple):
    """Motion of solids in physics steps, as in `cloth.batch_solver.SolidMotion`.

    Attributes:
        poses: positions [m] and quaternions (w, x, y, z) at the start of the step (..., k, 7).
        velocities: velocities [m/s] of the centers of mass of their bodies and angular velocities
            [rad/s] at the start (..., k, 6).
        accelerations: mean accelerations of both in the step (..., k, 6) [m/s^2], [rad/s^2].
    """

    poses: jax.Array
    velocities: jax.Array
    accelerations: jax.Array


def solids_of(arm: Arm, grasp: str) -> Solids:
    """Returns the solids of an arm's hand for a grasp of `GRASPS`."""
    model, geoms = models.solid_model(arm, grasp)
    names = [model.geom(geom).name.split("/")[-1] for geom in geoms]
    return Solids(
        np.isin(names, arm.pad_geoms),
        model.geom_bodyid[geoms],
        model.geom_pos[geoms],
        turns.matrices(model.geom_quat[geoms]),
    )


def jacobians(arm: Dynamics, solids: Solids, pose: Pose, yaw: jax.Array) -> jax.Array:
    """Returns the Jacobians (k, 6, m) of velocity and angular velocity of solids.

    Velocities are those of the centers of mass of the solids' bodies, in the world.

    Args:
        arm: the arm.
        solids: solids of its hand.
        pose: its pose.
        yaw: rotation (3, 3) of its mount.
    """
    body = solids.body
    centers = pose.position[body] + chains.apply(pose.rotation[body], arm.center[body])
    parts = chains.jacobians(arm.chain, pose, centers, body)
    return jnp.concatenate([chains.product(yaw, part) for part in parts], axis=1)


def responses(jacobians: jax.Array, inertia: jax.Array) -> jax.Array:
    """Returns joint velocities (k, m, 6) per unit impulse and angular impulse on solids.

    Args:
        jacobians: result of `jacobians`.
        inertia: result of `dynamics.step`.
    """
    count, _, joints = jacobians.shape
    factor = jax.scipy.linalg.cho_factor(inertia, lower=True)
    columns = jax.scipy.linalg.cho_solve(factor, jacobians.reshape(-1, joints).T)
    return columns.T.reshape(count, 6, joints).swapaxes(1, 2)


def steps(
    arm: Dynamics,
    solids: Solids,
    pose: Pose,
    before: jax.Array,
    after: jax.Array,
    base: jax.Array,
    yaw: jax.Array,
) -> SolidSteps:
    """Returns the motion of the solids of one arm in a physics step.

    Args:
        arm: the arm.
        solids: solids of its hand.
        pose: its pose at the start.
        before, after: joint speeds at the start and at the end (m,) [rad/s or m/s].
        base, yaw: position [m] (3,) and rotation (3, 3) of its mount.
    """
    body = solids.body
    frame = pose.rotation[body]
    points = base + chains.apply(yaw, pose.position[body] + chains.apply(frame, solids.position))
    turned = chains.product(yaw, chains.product(frame, solids.rotation))
    rates = jacobians(arm, solids, pose, yaw)
    return SolidSteps(
        jnp.concatenate([points, quaternions(turned)], axis=-1),
        chains.apply(rates, before),
        chains.apply(rates, (after - before) / arm.timestep),
    )


def quaternions(matrices: jax.Array) -> jax.Array:
    """Returns unit quaternions (..., 4) as (w, x, y, z) of rotation matrices (..., 3, 3)."""
    xx, yy, zz = (matrices[..., i, i] for i in range(3))
    yz, zx, xy = (matrices[..., i, j] + matrices[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    x, y, z = (matrices[..., i, j] - matrices[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0)))
    # Row i is the quaternion times four times its entry i; the largest is the most accurate.
    rows = jnp.stack(
        [
            jnp.stack([1.0 + xx + yy + zz, x, y, z], axis=-1),
            jnp.stack([x, 1.0 + xx - yy - zz, xy, zx], axis=-1),
            jnp.stack([y, xy, 1.0 - xx + yy - zz, yz], axis=-1),
            jnp.stack([z, zx, yz, 1.0 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    sizes = jnp.stack([rows[..., i, i] for i in range(4)], axis=-1)
    largest = jnp.argmax(sizes, axis=-1)[..., None, None]
    row = jnp.take_along_axis(rows, largest, axis=-2)[..., 0, :]
    return row / jnp.sqrt((row**2).sum(-1, keepdims=True))
