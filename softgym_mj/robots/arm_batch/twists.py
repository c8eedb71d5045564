"""Twists of rigid motions: logarithm in SE(3), and its derivative.

A twist (6,) has its velocity first, then its rotation vector. Formulas: Barfoot, State Estimation
for Robotics (2017), section 7.1.5; the inverse Jacobian as a polynomial: Bullo and Murray,
Proportional Derivative (PD) Control on the Euclidean Group (1995).
"""

import jax
import jax.numpy as jnp

from softgym_mj.robots.arm_batch.chain import apply, product

SMALL = 1e-2  # [rad] Below, series replace quotients.
LEAST = 1e-10  # [rad^2] Below this squared angle, mink takes the identity as inverse Jacobian.


def logarithm(rotation: jax.Array, position: jax.Array) -> jax.Array:
    """Returns the twist (6,) of a rotation matrix (3, 3) and a position [m] (3,)."""
    sine = 0.5 * jnp.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    size = jnp.sqrt((sine**2).sum())
    angle = jnp.arctan2(size, 0.5 * (jnp.trace(rotation) - 1.0))
    small = size < SMALL
    ratio = jnp.where(small, 1.0 + size**2 / 6.0, angle / jnp.where(small, 1.0, size))
    turn = ratio * sine
    matrix, squared = _cross(turn), (turn**2).sum()
    second = _cross_square(turn, squared)
    quadratic = jnp.where(
        squared < SMALL**2, 1.0 / 12.0 + squared / 720.0, _quadratic(jnp.maximum(squared, SMALL**2))
    )
    velocity = position - 0.5 * apply(matrix, position) + quadratic * apply(second, position)
    return jnp.concatenate([velocity, turn])


def inverse_jacobian(twist: jax.Array) -> jax.Array:
    """Returns the inverse left Jacobian (6, 6) of SE(3) at a twist (6,), as mink does."""
    velocity, turn = twist[:3], twist[3:]
    squared = (turn**2).sum()
    zero = jnp.zeros((3, 3))
    bracket = jnp.block([[_cross(turn), _cross(velocity)], [zero, _cross(turn)]])
    square = product(bracket, bracket)
    safe = jnp.maximum(squared, SMALL**2)
    angle = jnp.sqrt(safe)
    sin, versed = jnp.sin(angle), 1.0 - jnp.cos(angle)
    second = 2.0 / safe - (angle + 3.0 * sin) / (4.0 * angle * versed)
    fourth = 1.0 / safe**2 - (angle + sin) / (4.0 * angle**3 * versed)
    small = squared < SMALL**2
    second = jnp.where(small, 1.0 / 12.0, second)
    fourth = jnp.where(small, -1.0 / 720.0, fourth)
    found = second * square + fourth * product(square, square) - 0.5 * bracket
    return jnp.eye(6) + jnp.where(squared < LEAST, 0.0, found)


def _quadratic(squared: jax.Array) -> jax.Array:
    angle = jnp.sqrt(squared)
    return 1.0 / squared - jnp.sin(angle) / (2.0 * angle * (1.0 - jnp.cos(angle)))


def _cross(vector: jax.Array) -> jax.Array:
    x, y, z = vector
    zero = jnp.zeros_like(x)
    return jnp.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def _cross_square(vector: jax.Array, squared: jax.Array) -> jax.Array:
    return vector[:, None] * vector - squared * jnp.eye(3)
