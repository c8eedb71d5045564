"""`Chain`: links and joints of one arm, with the positions, Jacobians and speeds of its points.

Functions are for one arm, in the frame of its mount; `jax.vmap` adds axes of environments and arms.
"""

from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from softgym_mj.robots.arm import turns

Matrix: TypeAlias = jax.Array | np.ndarray


class Chain(NamedTuple):
    """Tree of n bodies with m joints (hinges or slides), the world first.

    Attributes:
        parent: index of each body's parent (n,).
        position: position of each body in its parent [m] (n, 3).
        rotation: rotation of each body in its parent (n, 3, 3).
        joint: index of each body's joint (n,); m if it has none.
        anchor: position of each body's joint in the body [m] (n, 3).
        axis: axis of each body's joint in the body (n, 3); 0 if it has none.
        slides: whether each body's joint is a slide (n,).
        zero: joint positions of the model's reference [rad or m] (m,).
        body: body that each joint moves (m,).
        moves: whether each joint moves each body (n, m).
    """

    parent: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    joint: np.ndarray
    anchor: np.ndarray
    axis: np.ndarray
    slides: np.ndarray
    zero: np.ndarray
    body: np.ndarray
    moves: np.ndarray


class Pose(NamedTuple):
    """Poses in the frame of the mount.

    Attributes:
        position: positions of bodies [m] (n, 3).
        rotation: rotation matrices of bodies (n, 3, 3).
        anchor: positions of joints [m] (m, 3).
        axis: axes of joints (m, 3).
    """

    position: jax.Array
    rotation: jax.Array
    anchor: jax.Array
    axis: jax.Array


def chain_of(model: mujoco.MjModel) -> Chain:
    """Returns the chain of a model whose joints are hinges and slides, at most one for a body."""
    assert model.nv == model.njnt == len(set(model.jnt_bodyid)), "one joint for a body"
    bodies, joints = model.nbody, model.njnt
    joint, anchor, axis = np.full(bodies, joints), np.zeros((bodies, 3)), np.zeros((bodies, 3))
    slides, moves = np.zeros(bodies, bool), np.zeros((bodies, joints), bool)
    for i, body in enumerate(model.jnt_bodyid):
        joint[body], anchor[body], axis[body] = i, model.jnt_pos[i], model.jnt_axis[i]
        slides[body] = model.jnt_type[i] == mujoco.mjtJoint.mjJNT_SLIDE
    for body in range(1, bodies):
        moves[body] = moves[model.body_parentid[body]]
        if joint[body] < joints:
            moves[body, joint[body]] = True
    return Chain(
        parent=model.body_parentid.copy(),
        position=model.body_pos.copy(),
        rotation=turns.matrices(model.body_quat),
        joint=joint,
        anchor=anchor,
        axis=axis,
        slides=slides,
        zero=model.qpos0.copy(),
        body=model.jnt_bodyid.copy(),
        moves=moves,
    )


def product(a: Matrix, b: Matrix) -> jax.Array:
    """Returns the products (..., n, m) of matrices (..., n, k) and (..., k, m)."""
    # Compilers fuse this with what is around it; a matrix product would be a call of a library.
    return (a[..., :, :, None] * b[..., None, :, :]).sum(-2)


def apply(matrices: Matrix, vectors: Matrix) -> jax.Array:
    """Returns the products (..., n) of matrices (..., n, k) and vectors (..., k)."""
    return (matrices * vectors[..., None, :]).sum(-1)


def poses(chain: Chain, angles: jax.Array) -> Pose:
    """Returns the poses of all bodies for joints at `angles` (m,) [rad or m]."""
    moved = jnp.append(angles - chain.zero, 0.0)[chain.joint]
    turn = jnp.where(chain.slides, 0.0, moved)
    slide = jnp.where(chain.slides, moved, 0.0)[:, None] * chain.axis
    cross = np.cross(np.eye(3), chain.axis[:, None, :])  # Matrices of the cross product.
    sin, cos = jnp.sin(turn)[:, None, None], jnp.cos(turn)[:, None, None]
    own = np.eye(3) + sin * cross + (1.0 - cos) * np.matmul(cross, cross)
    rotation, moved_anchor = product(chain.rotation, own), chain.anchor + slide

    def attach(found, body):
        parent, place, fixed, turned, before, after, index = body
        start, frame = found[0][parent], found[1][parent]
        matrix = product(frame, turned)
        point = start + apply(frame, place + apply(fixed, after)) - apply(matrix, before)
        return (found[0].at[index].set(point), found[1].at[index].set(matrix)), None

    number = len(chain.parent)
    start = jnp.zeros((number, 3)), jnp.tile(jnp.eye(3), (number, 1, 1))
    each = (
        chain.parent, chain.position, chain.rotation, rotation, chain.anchor, moved_anchor,
        np.arange(number),
    )  # fmt: skip
    rest = jax.tree.map(lambda array: array[1:], each)  # The world does not move.
    (position, matrix), _ = jax.lax.scan(attach, start, rest)
    joints = chain.body
    anchor = position[joints] + apply(matrix[joints], chain.anchor[joints])
    axis = apply(matrix[joints], chain.axis[joints])
    return Pose(position, matrix, anchor, axis)


def jacobians(
    chain: Chain, pose: Pose, points: jax.Array, bodies: np.ndarray
) -> tuple[jax.Array, jax.Array]:
    """Returns the Jacobians (k, 3, m) of velocity and angular velocity of points on bodies.

    Args:
        chain, pose: the arm.
        points: positions [m] (k, 3).
        bodies: body that each point moves with (k,).
    """
    slides, moves = chain.slides[chain.body][:, None], chain.moves[bodies][..., None]
    swept = jnp.cross(pose.axis, points[:, None] - pose.anchor)
    linear = jnp.where(moves, jnp.where(slides, pose.axis, swept), 0.0)
    angular = jnp.where(moves & ~slides, pose.axis, 0.0)
    return jnp.swapaxes(linear, 1, 2), jnp.swapaxes(angular, 1, 2)
