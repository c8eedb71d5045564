"""Arrays for functions of the library."""

import numpy as np

ALIGNMENT = 64  # [bytes] Of the widest vectors.


def aligned(size: int) -> np.ndarray:
    """Zeros (size,) uint8 that begin at a multiple of `ALIGNMENT`."""
    whole = np.zeros(size + ALIGNMENT, np.uint8)
    first = -whole.ctypes.data % ALIGNMENT
    return whole[first : first + size]
