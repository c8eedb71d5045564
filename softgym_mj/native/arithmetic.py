"""Sums of products whose bits are the same on every processor.

BLAS and LAPACK, which are behind `@`, `np.dot`, `np.vecdot`, the norm of a single vector and the
decompositions of `np.linalg`, choose their order of summation by the processor. What decides how a
simulation goes on must not depend on that: it uses these functions. NumPy's sines, logarithms and
powers of arrays differ as well, by a last bit; those of `math` do not. Neither do NumPy's `sum`,
`einsum` and norms along an axis.
"""

import math

import numpy as np


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The matrix product `a @ b`.

    Args:
        a: matrices (..., n, k).
        b: matrices (..., k, m), or a vector (k,).

    Returns:
        (..., n, m), or (..., n) of a vector.
    """
    if b.ndim == 1:
        return (a * b).sum(axis=-1)
    return (a[..., None] * b[..., None, :, :]).sum(axis=-2)


def squares(vectors: np.ndarray) -> np.ndarray:
    """The squared lengths (...) of vectors (..., n)."""
    return (vectors * vectors).sum(axis=-1)


def length(vector: np.ndarray) -> float:
    """The length of a vector (n,)."""
    return math.sqrt(squares(vector))
