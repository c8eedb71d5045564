"""Concatenated arrays of different size."""

import numpy as np


def part_of(array: np.ndarray, first: np.ndarray, number: np.ndarray, i: int) -> np.ndarray:
    """Returns part `i` of an array (number[i], ...), which begins at first[i]."""
    return array[first[i] : first[i] + number[i]]


def starts_of(numbers: np.ndarray, count: int) -> np.ndarray:
    """Returns the first index of each of 0..count among sorted numbers (count + 1,)."""
    return np.searchsorted(np.sort(numbers), np.arange(count + 1)).astype("i4")
