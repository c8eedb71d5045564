"""Arrays whose parts differ in size, one after the other."""

import numpy as np


def part_of(array: np.ndarray, first: np.ndarray, number: np.ndarray, i: int) -> np.ndarray:
    """Part `i` of an array, (number[i], ...), which begins at first[i]."""
    return array[first[i] : first[i] + number[i]]


def starts_of(numbers: np.ndarray, count: int) -> np.ndarray:
    """Where each of 0..count begins among sorted numbers: (count + 1,)."""
    return np.searchsorted(np.sort(numbers), np.arange(count + 1)).astype("i4")
