"""`PaddedRows`: what many episodes start with, or are at, in arrays with a row for each."""

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.metrics import Array


class PaddedRows:
    """Numbers, arrays, and dicts of such, of many; padded with zeros where they differ in size.

    As `tasks.shared.state.stack` has them, but that single rows change, and there may be more.

    Attributes:
        whole: dict of arrays with a leading dimension, and of such dicts.
        grown: how many times an array has been replaced by a larger one.
    """

    def __init__(self, number: int, device: Device):
        """Empty rows.

        Args:
            number: of rows, at first.
            device: where they are.
        """
        self._number, self._device = number, device
        self.whole: dict[str, Any] = {}
        self.grown = 0

    def put(self, i: int, values: Mapping[str, Any]) -> None:
        """Sets row `i`; all rows have the same names and numbers of dimensions."""
        while i >= self._number:
            self._number *= 2
        self._put(self.whole, i, values)

    def _put(self, whole: dict[str, Any], i: int, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            if isinstance(value, Mapping):
                self._put(whole.setdefault(name, {}), i, value)
                continue
            array = np.asarray(value)
            whole[name] = self._grown(whole.get(name), array.shape, array.dtype.name)
            whole[name][i] = 0
            part = tuple(slice(size) for size in array.shape)
            whole[name][i, ...][part] = self._device.put(array)

    def _grown(self, whole: Array | None, shape: tuple[int, ...], dtype: str) -> Array:
        """An array with a row of at least a shape for each, and what was in it."""
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
        """Has arrays stay where they are: what is new in the end goes where the old was.

        A graph of a GPU knows them by their places.
        """
        before = leaves(self.whole)
        yield
        for (whole, name, old), (_, _, new) in zip(before, leaves(self.whole), strict=True):
            if new is not old:
                old[...] = new
                whole[name] = old

    def fit(self, others: "PaddedRows") -> None:
        """Makes room for any row of others."""
        self._fit(self.whole, others.whole)

    def _fit(self, whole: dict[str, Any], others: dict[str, Any]) -> None:
        for name, other in others.items():
            if isinstance(other, dict):
                self._fit(whole.setdefault(name, {}), other)
                continue
            dtype = str(other.dtype).rpartition(".")[2]
            whole[name] = self._grown(whole.get(name), tuple(other.shape[1:]), dtype)

    def take(self, which: Array, others: "PaddedRows", rows: Array) -> None:
        """Sets those of some to rows of others, for which there is room.

        Args:
            which: (number,) bool.
            others: have room for what any of these has had.
            rows: (number,) of `others`; anything where not `which`.
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
    """Dict, name in it and array, of all arrays in dicts in dicts."""
    found = []
    for name, value in whole.items():
        found += leaves(value) if isinstance(value, dict) else [(whole, name, value)]
    return found
