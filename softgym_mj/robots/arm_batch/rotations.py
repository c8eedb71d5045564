"""Rotations as vectors [rad], unit quaternions (w, x, y, z) and matrices: `arm.turns` for JAX."""

import jax
import jax.numpy as jnp
import numpy as np


def quaternions(vectors: jax.Array) -> jax.Array:
    """Returns unit quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    angles = jnp.sqrt((vectors**2).sum(-1, keepdims=True))
    axes = vectors / jnp.maximum(angles, 1e-15)
    return jnp.concatenate([jnp.cos(angles / 2.0), jnp.sin(angles / 2.0) * axes], axis=-1)


def vectors(turns: jax.Array) -> jax.Array:
    """Returns rotation vectors (..., 3) [rad], at most pi long, of unit quaternions (..., 4)."""
    sines = jnp.sqrt((turns[..., 1:] ** 2).sum(-1, keepdims=True))
    angles = 2.0 * jnp.arctan2(sines, turns[..., :1])
    angles = jnp.where(angles > np.pi, angles - 2.0 * np.pi, angles)
    return angles * turns[..., 1:] / jnp.maximum(sines, 1e-15)


def compose(second: jax.Array, first: jax.Array) -> jax.Array:
    """Returns the rotations (..., 4) by `first` (..., 4), then by `second` (..., 4)."""
    a, b, c, d = jnp.moveaxis(second, -1, 0)
    w, x, y, z = jnp.moveaxis(first, -1, 0)
    both = (
        a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
    )  # fmt: skip
    turns = jnp.stack(both, axis=-1)
    return turns / jnp.sqrt((turns**2).sum(-1, keepdims=True))


def between(start: jax.Array, end: jax.Array) -> jax.Array:
    """Returns rotation vectors (..., 3) [rad] in world axes from rotations (..., 4) to others."""
    return vectors(compose(end, start * np.array([1.0, -1.0, -1.0, -1.0])))


def matrices(turns: jax.Array) -> jax.Array:
    """Returns rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = jnp.moveaxis(turns, -1, 0)
    rows = (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip
    return jnp.stack(rows, axis=-1).reshape(*turns.shape[:-1], 3, 3)


def upright(turns: jax.Array, most: float) -> jax.Array:
    """Returns orientations (..., 4) of tools, tilted back to at most `most` [rad]."""
    x, y, z = jnp.moveaxis(matrices(turns)[..., 2], -1, 0)
    across = jnp.stack([-y, x, jnp.zeros_like(x)], axis=-1)
    sine = jnp.sqrt((across**2).sum(-1, keepdims=True))
    # A tool that points straight up has no axis of its own.
    axis = jnp.where(sine > 1e-15, across / jnp.maximum(sine, 1e-15), np.array([1.0, 0.0, 0.0]))
    angle = jnp.maximum(jnp.arctan2(sine, -z[..., None]) - most, 0.0)
    return compose(quaternions(angle * axis), turns)
