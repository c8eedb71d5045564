"""`Device`: where the arrays of environments are, and what makes their steps: this processor."""

import ctypes
from collections.abc import Callable, Hashable
from typing import Any, Protocol

import numpy as np

from softgym_mj.native.library import open_library

ALIGNMENT = 64  # [bytes] Of what kernels get: of the widest vectors.


class Copy(Protocol):
    """A copy of an array as it was, on its way to NumPy.

    Attributes:
        done: whether it has come.
    """

    done: bool

    def wait(self) -> np.ndarray:
        """The array (...), once it has come."""


class Device(Protocol):
    """Arrays of NumPy or PyTorch, and kernels that step environments of a kind which lie in them.

    Attributes:
        xp: the arrays' namespace.
        xp_device: `device` argument of its functions; None for NumPy.
    """

    xp: Any
    xp_device: Any

    def max_slots(self, kind: str, size: int) -> int:
        """How many environments of a kind it works on at a time, at most; `size` as of `step`."""

    def zeros(self, shape: tuple[int, ...], dtype: str) -> Any:
        """Zeros (...), of a type by its name; their memory begins at a multiple of `ALIGNMENT`."""

    def put(self, array: np.ndarray) -> Any:
        """A copy (...) of an array."""

    def get(self, array: Any) -> np.ndarray:
        """A copy of an array (...), in NumPy."""

    def copy(self, array: Any) -> Copy:
        """Begins what `get` does, and waits for nothing."""

    def address(self, array: Any) -> int:
        """Where the memory of an array begins."""

    def repeat(self, key: Hashable, function: Callable[[], Any], name: str = "") -> Any:
        """What a function returns: arrays, in dicts and tuples, that later calls leave alone.

        Args:
            key: as long as it is the same the function does the same with arrays in the same
                memory, whatever is in them, and need not be called.
            function: reads and writes arrays, and asks for none of their numbers.
            name: of the function, if there are several.
        """

    def step(self, kind: str, batch: Any, num_slots: int, size: int) -> None:
        """Makes, or begins, a step of environments of a kind.

        Args:
            kind: of `batch.solver.BatchSolver`.
            batch: its `Batch`, as bytes.
            num_slots: how many are worked on at a time.
            size: how much there is to do at a time in each: points.
        """


class _Copied(Copy):
    done = True

    def __init__(self, array: np.ndarray):
        self._array = array

    def wait(self) -> np.ndarray:
        return self._array


class CpuDevice(Device):
    """This processor."""

    xp: Any = np
    xp_device: Any = None

    def __init__(self, num_threads: int = 1, turns: int = 0):
        """Notes how environments are stepped.

        Args:
            num_threads: that step environments at a time.
            turns: in which order each part of a step is done, which changes no bit: for tests.
        """
        self._threads, self._turns = num_threads, turns

    def max_slots(self, kind: str, size: int) -> int:
        return self._threads

    def zeros(self, shape: tuple[int, ...], dtype: str) -> np.ndarray:
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        whole = np.zeros(size + ALIGNMENT, np.uint8)
        first = -whole.ctypes.data % ALIGNMENT
        return whole[first : first + size].view(dtype).reshape(shape)

    def put(self, array: np.ndarray) -> np.ndarray:
        copy = self.zeros(array.shape, array.dtype.name)
        copy[...] = array
        return copy

    def get(self, array: np.ndarray) -> np.ndarray:
        return np.array(array)

    def copy(self, array: np.ndarray) -> Copy:
        return _Copied(self.get(array))

    def address(self, array: np.ndarray) -> int:
        return array.ctypes.data

    def repeat(self, key: Hashable, function: Callable[[], Any], name: str = "") -> Any:
        return function()

    def step(self, kind: str, batch: np.ndarray, num_slots: int, size: int) -> None:
        function(kind, "step")(ctypes.c_void_p(batch.ctypes.data), num_slots, self._turns)


def function(kind: str, name: str) -> Any:
    """A function of the library for environments of a kind."""
    found = getattr(open_library(), f"softgym_mj_{kind}_batch_{name}")
    return found
