"""`BatchSolver`: many environments that a kernel of the library steps together, without MuJoCo."""

import ctypes
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from softgym_mj.batch.device import ALIGNMENT, CpuDevice, Device, function
from softgym_mj.batch.queue import Queue
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError

NOT_FINITE = 1  # The first of what may go wrong in a step, as bits.

_REASON = 256  # [characters]

Array = Any  # Of NumPy or PyTorch.
# Name of a size or a number, further sizes, name of the type.
Shape = tuple[str | int, tuple[int, ...], str]


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def describe(
    kind: str, model: mujoco.MjModel, data: mujoco.MjData, ids: np.ndarray, *settings: Any
) -> np.ndarray:
    """What environments of a kind have to know of a model, as bytes (size,) uint8.

    Args:
        kind: "cloth" or "fluid".
        model, data: what is to be stepped.
        ids: (n,) of what is told where to go.
        settings: further arguments of the library's function.

    Raises:
        InvalidArgumentError: if there is anything in it that cannot be stepped.
    """
    write, device = function(kind, "model"), CpuDevice()
    ids, error = np.ascontiguousarray(ids, np.int32), np.zeros(_REASON, np.uint8)
    out = device.zeros((0,), "uint8")
    for _ in range(2):  # Its size, then its content.
        size = write(
            ctypes.c_void_p(model._address), ctypes.c_void_p(data._address), _pointer(ids),
            len(ids), *settings, _pointer(out), len(out), _pointer(error), _REASON,
        )  # fmt: skip
        if not size:
            reason = error.tobytes().split(b"\0")[0].decode()
            raise InvalidArgumentError(f"model cannot be stepped in a batch: {reason}")
        out = out if len(out) == size else device.zeros((size,), "uint8")
    return out


class BatchSolver:
    """The state of environments, arrays with a row for each, and their steps.

    Environments differ in size: rows have room for the largest model. A subclass names the state.

    Attributes:
        kind: of the library's functions.
        fields: shapes of the arrays of the state by name, (num_envs, size, ...), each an
            attribute of its name: the first size is a name or a number.
        told: those of what environments are told in a step, likewise.
        device: where the arrays are.
        models: (num_envs,) int64 what environments play, from `load`; those of 0 stand still.
        queue: in which order they are begun on a GPU.
        flags: what went wrong so far, as bits (num_envs,) int32.
        grown: how many times the memory of steps has been replaced by a larger one.
    """

    kind: str
    fields: Mapping[str, tuple[str | int, *tuple[int, ...]]]
    told: Mapping[str, Shape]

    def __init__(self, num_envs: int, sizes: Mapping[str, int], device: Device | None = None):
        """Environments of zeros without models.

        Args:
            num_envs: how many.
            sizes: of the largest model by name; all have as many of the last ones, which are told
                where to go.
            device: where they are; None for this processor.
        """
        self.device = device = device or CpuDevice()
        self._number, self._sizes = num_envs, dict(sizes)
        for name, (size, *more) in self.fields.items():
            setattr(self, name, device.zeros((num_envs, self._size(size, sizes), *more), "float64"))
        self._told = {
            name: device.zeros((num_envs, self._size(size, sizes), *more), dtype)
            for name, (size, more, dtype) in self.told.items()
        }
        self.models = device.zeros((num_envs,), "int64")
        self.queue = Queue(num_envs, device)
        self.flags = device.zeros((num_envs,), "int32")
        self.grown = 0
        self._slots = min(num_envs, device.max_slots(self.kind, self._most))
        self._kept: Array = device.zeros((num_envs, 0), "uint8")
        self._memory: Array = device.zeros((self._slots, 0), "uint8")
        self._loaded: dict[bytes, tuple[int, Array]] = {}
        self._counts: dict[int, dict[str, int]] = {}  # Sizes of models.
        self._batch: Array = None  # `Batch` of the kind's batch/host.h, as bytes.

    @staticmethod
    def _size(kind: str | int, sizes: Mapping[str, int]) -> int:
        return sizes[kind] if isinstance(kind, str) else kind

    def rows(self) -> dict[str, Array]:
        """The arrays of the state, and `models` as "model", by name."""
        return {**{name: getattr(self, name) for name in self.fields}, "model": self.models}

    # ------------------------------------------------------------------ models

    def load(self, model: np.ndarray) -> int:
        """Gets a model from `describe` ready for environments; returns what `models` says of these.

        Raises:
            InvalidArgumentError: for one that is larger than the rows.
        """
        key = model.tobytes()
        if key in self._loaded:
            return self._loaded[key][0]
        found = np.zeros(len(self._sizes), np.int32)
        function(self.kind, "counts")(_pointer(model), _pointer(found))
        counts, last = dict(zip(self._sizes, found.tolist(), strict=True)), [*self._sizes][-1]
        fits = all(counts[name] <= most for name, most in self._sizes.items())
        if not fits or counts[last] != self._sizes[last]:
            raise InvalidArgumentError("model", counts, f"within {self._sizes}")
        needed = np.zeros(2, np.int64)
        function(self.kind, "memory")(_pointer(model), _pointer(needed))
        kept, memory = (-(-needed // ALIGNMENT) * ALIGNMENT).tolist()
        if kept > self._kept.shape[1] or memory > self._memory.shape[1]:
            kept, memory = max(kept, self._kept.shape[1]), max(memory, self._memory.shape[1])
            self._kept = self._memory = self._batch = None  # What they held can be found again.
            self.grown += 1
            self._kept = self.device.zeros((self._number, kept), "uint8")
            self._memory = self.device.zeros((self._slots, memory), "uint8")
        there = self.device.put(model)
        address = self.device.address(there)
        self._loaded[key], self._counts[address] = (address, there), counts
        return address

    # ------------------------------------------------------------------ one environment

    def start(self, i: int, model: np.ndarray) -> None:
        """Gives environment `i` a model, from `describe`, and empties its rows."""
        self.models[i] = self.load(model)
        for name in self.fields:
            getattr(self, name)[i] = 0.0
        self.flags[i] = 0

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """The state of environment `i` (n, ...) by name, for `set_state`."""
        address = int(self.models[i])
        if not address:
            raise LifecycleError(
                f"environment {i} has no model yet: call start() before get_state()"
            )
        counts = self._counts[address]
        return {
            name: self.device.get(getattr(self, name)[i, : self._size(kind, counts)])
            for name, (kind, *_) in self.fields.items()
        }

    def set_state(self, i: int, state: Mapping[str, np.ndarray]) -> None:
        """Restores what `get_state` returned: what follows has the same bits."""
        for name, array in state.items():
            getattr(self, name)[i] = 0.0
            getattr(self, name)[i, : len(array)] = array

    # ------------------------------------------------------------------ all

    def _step(self, **told: Array) -> None:
        """Makes a step of all environments that are told this, by name."""
        for name, array in told.items():
            self._told[name][...] = array
        if self._batch is None:
            self._batch = self._written()
        self.queue.begin()
        self.device.step(self.kind, self._batch, self._slots, self._most)

    @property
    def _most(self) -> int:
        """Points of the largest model."""
        return next(iter(self._sizes.values()))

    def _written(self) -> Array:
        """`Batch`: ints, then pointers."""
        memory = self._kept.shape[1], self._slots, self._memory.shape[1]
        sizes = np.array([self._number, *self._sizes.values(), *memory], np.int64)
        arrays = [
            self.models,
            self._kept,
            self._memory,
            *(getattr(self, name) for name in self.fields),
        ]
        arrays += [*self._told.values(), *self.queue.arrays, self.flags]
        pointers = [self.device.address(array) for array in arrays]
        return self.device.put(np.concatenate([sizes, np.array(pointers, np.int64)]))
