"""`PaddedRows`: nested arrays with a row per episode, padded with zeros to a common size."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import stack

_TOGETHER = 64  # Rows that are copied to a device at a time, through buffers of some megabytes.


class PaddedRows:
    """Rows of numbers, arrays and dicts of these, padded with zeros where sizes differ.

    Like `tasks.shared.state.stack`, but single rows can be set and rows can be added.

    Attributes:
        whole: Dict of arrays with a leading row dimension, and of such dicts.
        grown: Number of times that an array has been replaced by a larger one.
    """

    def __init__(self, number: int, device: Device):
        """Makes empty rows.

        Args:
            number: Initial number of rows.
            device: Device of the arrays.
        """
        self._number, self._device = number, device
        self._used = 0  # Rows from here on are zeros.
        self.whole: dict[str, Any] = {}
        self.grown = 0

    def put(self, i: int, values: Mapping[str, Any]) -> None:
        """Sets row `i`; all rows must have the same names and numbers of dimensions."""
        self.put_all(i, [values])

    def put_all(self, first: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Sets rows from `first` on, with one array per name for the device."""
        while first + len(rows) > self._number:
            self._number *= 2
        self._put(self.whole, first, rows)
        self._used = max(self._used, first + len(rows))

    def _put(self, whole: dict[str, Any], first: int, rows: Sequence[Mapping[str, Any]]) -> None:
        for name in rows[0]:
            values = [row[name] for row in rows]
            if isinstance(values[0], dict):
                self._put(whole.setdefault(name, {}), first, values)
                continue
            arrays = [np.asarray(value) for value in values]
            shape = tuple(map(max, zip(*(array.shape for array in arrays), strict=True)))
            whole[name] = self._grown(whole.get(name), shape, arrays[0].dtype.name)
            if first < self._used:
                whole[name][first : first + len(rows)] = 0
            self._fill(whole[name][first : first + len(rows)], arrays)

    def _fill(self, rows: Array, arrays: Sequence[np.ndarray]) -> None:
        """Copies arrays into rows of zeros; padding is not written on this processor."""
        if isinstance(rows, np.ndarray):
            for i, array in enumerate(arrays):
                own: tuple[Any, ...] = (i, *map(slice, array.shape))
                rows[own] = array
            return
        for i in range(0, len(arrays), _TOGETHER):
            some = stack(arrays[i : i + _TOGETHER])
            at = slice(i, i + len(some)), *map(slice, some.shape[1:])
            rows[at] = self._device.put(some)

    def _grown(self, whole: Array | None, shape: tuple[int, ...], dtype: str) -> Array:
        """Returns an array whose rows have at least `shape`, with the old content."""
        before = shape if whole is None else tuple(whole.shape[1:])
        shape = (self._number, *(max(sizes) for sizes in zip(before, shape, strict=True)))
        if whole is not None and tuple(whole.shape) == shape:
            return whole
        self.grown += 1
        larger = self._device.zeros(shape, dtype)
        if whole is not None:
            larger[tuple(slice(size) for size in whole.shape)] = whole
        return larger

    @contextlib.contextmanager
    def kept(self) -> Iterator[None]:
        """Keeps arrays at their addresses: copies new arrays into the old ones at the end.

        CUDA graphs refer to arrays by address.
        """
        before = leaves(self.whole)
        yield
        for (whole, name, old), (_, _, new) in zip(before, leaves(self.whole), strict=True):
            if new is not old:
                old[...] = new
                whole[name] = old

    def fit(self, others: "PaddedRows") -> None:
        """Grows arrays to hold any row of `others`."""
        self._fit(self.whole, others.whole)

    def _fit(self, whole: dict[str, Any], others: dict[str, Any]) -> None:
        for name, other in others.items():
            if isinstance(other, dict):
                self._fit(whole.setdefault(name, {}), other)
                continue
            dtype = str(other.dtype).rpartition(".")[2]
            whole[name] = self._grown(whole.get(name), tuple(other.shape[1:]), dtype)

    def take(self, which: Array, others: "PaddedRows", rows: Array) -> None:
        """Copies rows of `others` into selected rows.

        Args:
            which: Selected rows (number,) bool.
            others: Source rows, no larger than these rows; `fit` enlarges these.
            rows: Rows (number,) of `others`; ignored where not `which`.
        """
        self._take(self.whole, others.whole, which, rows)

    def _take(self, whole: dict[str, Any], others: dict[str, Any], which: Array, rows: Array):
        for name, other in others.items():
            if isinstance(other, dict):
                self._take(whole[name], other, which, rows)
                continue
            chosen = which.reshape((-1, *[1] * (other.ndim - 1)))
            part = whole[name][(slice(None), *(slice(size) for size in other.shape[1:]))]
            part[...] = self._device.xp.where(chosen, other[rows], part)


def leaves(whole: dict[str, Any]) -> list[tuple[dict[str, Any], str, Array]]:
    """Returns (dict, key, array) for all arrays in nested dicts."""
    found = []
    for name, value in whole.items():
        found += leaves(value) if isinstance(value, dict) else [(whole, name, value)]
    return found
