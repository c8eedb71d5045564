"""`BatchSolver`: steps many environments together by a kernel of the library, without MuJoCo."""

import ctypes
import hashlib
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from softgym_mj.batch.device import ALIGNMENT, CpuDevice, Device, function
from softgym_mj.batch.queue import Queue
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError

NOT_FINITE = 1  # First bit of `flags`: the state is not finite.

_REASON = 256  # [characters] Longest error message of the library.

Array = Any  # NumPy or PyTorch array.
# First size (a name of `sizes` or a number), further sizes, dtype.
Shape = tuple[str | int, tuple[int, ...], str]


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Returns the address of an array for a function of the library."""
    return ctypes.c_void_p(array.ctypes.data)


def describe(
    kind: str, model: mujoco.MjModel, data: mujoco.MjData, ids: np.ndarray, *settings: Any
) -> np.ndarray:
    """Converts a MuJoCo model for a batch; returns the C++ struct `Model` as bytes (size,) uint8.

    Args:
        kind: "cloth" or "fluid".
        model, data: Model to step, and its data.
        ids: Ids (n,) of the geoms or bodies with prescribed motion.
        settings: Further arguments of the library's function.

    Raises:
        InvalidArgumentError: If batches do not support something in the model.
    """
    write, device = function(kind, "model"), CpuDevice()
    ids, error = np.ascontiguousarray(ids, np.int32), np.zeros(_REASON, np.uint8)
    out = device.zeros((0,), "uint8")
    for _ in range(2):  # The first call returns the size, the second one writes the content.
        size = write(
            ctypes.c_void_p(model._address), ctypes.c_void_p(data._address), pointer(ids),
            len(ids), *settings, pointer(out), len(out), pointer(error), _REASON,
        )  # fmt: skip
        if not size:
            reason = error.tobytes().split(b"\0")[0].decode()
            raise InvalidArgumentError(f"model cannot be stepped in a batch: {reason}")
        out = out if len(out) == size else device.zeros((size,), "uint8")
    return out


class BatchSolver:
    """Stores the state of environments as arrays with a row for each, and steps them.

    Rows have room for the largest model. A subclass defines the arrays.

    Attributes:
        kind: Kind of the library's functions.
        fields: Shapes of state arrays by name: the first size is a name of `sizes` or a number.
            Each array (num_envs, size, ...) is an attribute of its name.
        inputs: Shapes and dtypes of the inputs of a step by name.
        outputs: Shapes and dtypes of further results of a step by name, which are attributes.
        exact: Names of sizes that are the same in all models.
        last: Names of fields, inputs, outputs and sizes that the struct `Batch` has at its end.
        device: Device of the arrays.
        models: Models (num_envs,) int64 from `load`; environments with 0 are not stepped.
        queue: Order of environments on a GPU.
        flags: Failures so far as bits (num_envs,) int32.
        grown: Number of times that the memory of steps has been replaced by a larger one, or the
            kernel by one that also steps other models.
    """

    kind: str
    fields: Mapping[str, tuple[str | int, *tuple[int, ...]]]
    inputs: Mapping[str, Shape]
    outputs: Mapping[str, Shape] = {}
    exact: tuple[str, ...]
    last: tuple[str, ...] = ()
    _variant = ""  # Variant of the kernel, as in `Device.step`.

    def __init__(self, num_envs: int, sizes: Mapping[str, int], device: Device | None = None):
        """Allocates zeros, without models.

        Args:
            num_envs: Number of environments.
            sizes: Sizes of the largest model by name.
            device: Device of the arrays; None means this processor.
        """
        self.device = device = device or CpuDevice()
        self._number, self._sizes = num_envs, dict(sizes)
        for name, (size, *more) in self.fields.items():
            setattr(self, name, device.zeros((num_envs, self._size(size, sizes), *more), "float64"))
        self._inputs, outputs = (
            {
                name: device.zeros((num_envs, self._size(size, sizes), *more), dtype)
                for name, (size, more, dtype) in shapes.items()
            }
            for shapes in (self.inputs, self.outputs)
        )
        vars(self).update(outputs)
        self.models = device.zeros((num_envs,), "int64")
        self.queue = Queue(num_envs, device)
        self.flags = device.zeros((num_envs,), "int32")
        self.grown = 0
        self._slots = min(num_envs, device.max_slots(self.kind, self._most))
        self._kept: Array = device.zeros((num_envs, 0), "uint8")
        self._memory: Array = device.zeros((self._slots, 0), "uint8")
        self._loaded: dict[bytes, tuple[int, Array]] = {}
        self._counts: dict[int, dict[str, int]] = {}  # Sizes of models.
        self._batch: Array = None  # Struct `Batch` of the kind's batch/host.h, as bytes.

    @staticmethod
    def _size(kind: str | int, sizes: Mapping[str, int]) -> int:
        return sizes[kind] if isinstance(kind, str) else kind

    def rows(self) -> dict[str, Array]:
        """Returns the state arrays by name, and `models` as "model"."""
        return {**{name: getattr(self, name) for name in self.fields}, "model": self.models}

    # ------------------------------------------------------------------ models

    def load(self, model: np.ndarray) -> int:
        """Copies a model from `describe` to the device; returns its address, for `models`.

        Raises:
            InvalidArgumentError: If the model is larger than the rows.
        """
        found = np.zeros(len(self._sizes), np.int32)
        function(self.kind, "counts")(pointer(model), pointer(found))
        counts = dict(zip(self._sizes, found.tolist(), strict=True))
        fits = all(counts[name] <= most for name, most in self._sizes.items())
        if not fits or any(counts[name] != self._sizes[name] for name in self.exact):
            raise InvalidArgumentError("model", counts, f"within {self._sizes}")
        model = self._shared(model)
        key = hashlib.sha256(model.data).digest()
        if key in self._loaded:
            return self._loaded[key][0]
        needed = np.zeros(2, np.int64)
        function(self.kind, "memory")(pointer(model), pointer(needed))
        kept, memory = (-(-needed // ALIGNMENT) * ALIGNMENT).tolist()
        if kept > self._kept.shape[1] or memory > self._memory.shape[1]:
            kept, memory = max(kept, self._kept.shape[1]), max(memory, self._memory.shape[1])
            self._kept = self._memory = self._batch = None  # Their content can be recomputed.
            self.grown += 1
            self._kept = self.device.zeros((self._number, kept), "uint8")
            self._memory = self.device.zeros((self._slots, memory), "uint8")
        there = self.device.put(model)
        address = self.device.address(there)
        self._loaded[key], self._counts[address] = (address, there), counts
        return address

    def _shared(self, model: np.ndarray) -> np.ndarray:
        """Returns a model whose large parts are on the device, where models share them."""
        return model

    # ------------------------------------------------------------------ one environment

    def start(self, i: int, model: np.ndarray) -> None:
        """Sets the model of environment `i`, from `describe`, and its rows to zero."""
        self.models[i] = self.load(model)
        for name in self.fields:
            getattr(self, name)[i] = 0.0
        self.flags[i] = 0

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """Returns the state arrays of environment `i` by name, for `set_state`."""
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
        """Restores the result of `get_state`; later steps are bit-identical."""
        for name, array in state.items():
            getattr(self, name)[i] = 0.0
            getattr(self, name)[i, : len(array)] = array

    # ------------------------------------------------------------------ all

    def _step(self, **inputs: Array) -> None:
        """Makes a step of all environments with inputs by name."""
        for name, array in inputs.items():
            self._inputs[name][...] = array
        if self._batch is None:
            self._batch = self._written()
        self.queue.begin()
        self.device.step(self.kind, self._batch, self._slots, self._most, self._variant)

    @property
    def _most(self) -> int:
        """Number of points of the largest model."""
        return next(iter(self._sizes.values()))

    def _written(self) -> Array:
        """Returns the struct `Batch` as bytes: integers, then pointers, then `last`."""
        address = self.device.address
        fields = {name: getattr(self, name) for name in [*self.fields, *self.outputs]}
        arrays = {name: address(array) for name, array in {**fields, **self._inputs}.items()}
        numbers = [
            self._number,
            *(size for name, size in self._sizes.items() if name not in self.last),
            *(self._kept.shape[1], self._slots, self._memory.shape[1]),
            *map(address, (self.models, self._kept, self._memory)),
            *(value for name, value in arrays.items() if name not in self.last),
            *map(address, (*self.queue.arrays, self.flags)),
            *({**arrays, **self._sizes}[name] for name in self.last),
        ]
        return self.device.put(np.array(numbers, np.int64))
