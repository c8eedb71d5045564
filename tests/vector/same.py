"""Whether results of vector environments are the same."""

import numpy as np


def same(one, other):
    """Whether results of `step` or `reset` are equal: infos, masks and types of data, too."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray) and one.dtype == object:
        return same(one.tolist(), other.tolist())
    return np.asarray(one).dtype == np.asarray(other).dtype and np.array_equal(one, other)
