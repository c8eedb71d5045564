"""`Rows`: what many episodes start with, in arrays with a row for each."""

from collections.abc import Mapping
from typing import Any

import numpy as np


class Rows:
    """Numbers, arrays, and dicts of such, of many; padded with zeros where they differ in size.

    As `tasks.shared.state.stack` has them, but that single rows change.

    Attributes:
        whole: an array, or dict of such, with a leading dimension; None before the first `put`.
    """

    def __init__(self, number: int):
        """Empty rows.

        Args:
            number: of rows.
        """
        self._number = number
        self.whole: Any = None

    def put(self, i: int, values: Any) -> None:
        """Sets row `i`; all rows have the same names and numbers of dimensions."""
        self.whole = self._put(self.whole, i, values)

    def _put(self, whole: Any, i: int, values: Any) -> Any:
        if isinstance(values, Mapping):
            before = whole or {}
            return {name: self._put(before.get(name), i, value) for name, value in values.items()}
        array = np.asarray(values)
        shape = array.shape if whole is None else np.maximum(whole.shape[1:], array.shape)
        if whole is None or tuple(shape) != whole.shape[1:]:
            larger = np.zeros((self._number, *shape), array.dtype)
            if whole is not None:
                larger[tuple(slice(size) for size in whole.shape)] = whole
            whole = larger
        whole[i] = 0
        whole[i, ...][tuple(slice(size) for size in array.shape)] = array
        return whole
