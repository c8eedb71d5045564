"""Sums of products that are bit-identical on every processor.

BLAS and LAPACK, which compute `@`, `np.dot`, `np.vecdot`, the norm of a single vector and the
decompositions of `np.linalg`, choose their order of summation by the processor. Code that affects
a simulation uses these functions instead. NumPy's sines, logarithms and powers of arrays differ in
the last bit, too; those of `math` do not. NumPy's `sum`, `einsum` and norms along an axis are
identical.
"""

import math

import numpy as np


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns the matrix product `a @ b`.

    Args:
        a: Matrices (..., n, k).
        b: Matrices (..., k, m), or a vector (k,).

    Returns:
        Matrices (..., n, m), or vectors (..., n) if `b` is a vector.
    """
    if b.ndim == 1:
        return (a * b).sum(axis=-1)
    return (a[..., None] * b[..., None, :, :]).sum(axis=-2)


def squares(vectors: np.ndarray) -> np.ndarray:
    """Returns the squared lengths (...) of vectors (..., n)."""
    return (vectors * vectors).sum(axis=-1)


def length(vector: np.ndarray) -> float:
    """Returns the length of a vector (n,)."""
    return math.sqrt(squares(vector))


def interpolate(weights: np.ndarray, values: np.ndarray, axis: int) -> np.ndarray:
    """Returns linear interpolations along an axis, bit-identical to those by `np.einsum`.

    Args:
        weights: (n, m), in each row nonzero for at most two neighboring entries.
        values: (..., m, ...).
        axis: that of m.

    Returns:
        Sums (..., n, ...) of weights times values.
    """
    low = np.argmax(weights != 0.0, axis=1)
    high = np.minimum(low + 1, weights.shape[1] - 1)
    rows = np.arange(len(weights))
    shape = np.ones(values.ndim, int)
    shape[axis] = len(weights)
    first = weights[rows, low].reshape(shape)
    second = (weights[rows, high] * (high > low)).reshape(shape)
    return values.take(low, axis) * first + values.take(high, axis) * second
