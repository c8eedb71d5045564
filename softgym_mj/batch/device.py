"""`Device`: stores the arrays of a batch and runs its kernels; `CpuDevice` is this processor."""

import ctypes
from collections.abc import Callable, Hashable
from typing import Any, Protocol

import numpy as np

from softgym_mj.native.library import open_library

ALIGNMENT = 64  # [bytes] Alignment of kernel arguments: the widest SIMD vector.


class Copy(Protocol):
    """Asynchronous copy of an array to NumPy.

    Attributes:
        done: Whether the copy is complete.
    """

    done: bool

    def wait(self) -> np.ndarray:
        """Waits for the copy and returns it (...)."""


class Device(Protocol):
    """Device that stores batch arrays (NumPy or PyTorch) and runs step kernels.

    Attributes:
        xp: Array namespace.
        xp_device: `device` argument of its functions; None for NumPy.
    """

    xp: Any
    xp_device: Any

    def max_slots(self, kind: str, size: int) -> int:
        """Returns the largest number of environments stepped at a time; arguments as in `step`."""

    def zeros(self, shape: tuple[int, ...], dtype: str) -> Any:
        """Returns zeros (...) of a dtype by name, whose memory is aligned to `ALIGNMENT`."""

    def put(self, array: np.ndarray) -> Any:
        """Copies a NumPy array (...) to the device."""

    def get(self, array: Any) -> np.ndarray:
        """Copies an array (...) to NumPy."""

    def copy(self, array: Any) -> Copy:
        """Starts an asynchronous copy of an array (...) to NumPy."""

    def address(self, array: Any) -> int:
        """Returns the address of an array's memory."""

    def repeat(self, key: Hashable, function: Callable[[], Any], name: str = "") -> Any:
        """Runs a function, or replays it as a CUDA graph; returns copies of its results (...).

        Args:
            key: Identifies arrays and operations: with an equal key the function would apply the
                same operations to the same memory, so that it can be replayed.
            function: Reads and writes arrays without reading values on the host; returns arrays in
                dicts and tuples.
            name: Distinguishes functions.
        """

    def step(self, kind: str, batch: Any, num_slots: int, size: int, variant: str = "") -> None:
        """Steps all environments of a batch; a GPU only starts the step.

        Args:
            kind: Kind of the solver, "cloth" or "fluid", or "pictures".
            batch: The C++ struct `Batch` as bytes.
            num_slots: Number of environments stepped at a time.
            size: Points per environment, which set the threads of a block.
            variant: End of the name of a GPU's kernel, where a kind has several.
        """


class _Copied(Copy):
    done = True

    def __init__(self, array: np.ndarray):
        self._array = array

    def wait(self) -> np.ndarray:
        return self._array


class CpuDevice(Device):
    """This processor: NumPy arrays, stepped by threads."""

    xp: Any = np
    xp_device: Any = None

    def __init__(self, num_threads: int = 1, turns: int = 0):
        """Chooses threads and loop order.

        Args:
            num_threads: Number of threads; each steps one environment at a time.
            turns: Order of iterations in parallel loops, which must not change results (tests).
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

    def step(
        self, kind: str, batch: np.ndarray, num_slots: int, size: int, variant: str = ""
    ) -> None:
        function(kind, "step")(ctypes.c_void_p(batch.ctypes.data), num_slots, self._turns)


def function(kind: str, name: str) -> Any:
    """Returns a function of the C++ library by kind of batch and name."""
    return getattr(open_library(), f"softgym_mj_{kind}_batch_{name}")
