"""`Worlds`: many worlds that a program of the library steps together, without MuJoCo."""

import ctypes
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.native.library import load_plugin

NOT_FINITE = 1  # The first of what may go wrong in a step, as bits.

_ALIGNMENT = 64  # [bytes] Of models and memory: of the widest vectors.
_REASON = 256  # [characters]
# Results of functions that are not ints; all arguments are pointers or ints, but for doubles.
_RESULTS = {"scratch": ctypes.c_longlong}


def _aligned(size: int) -> np.ndarray:
    """Zeros (size,) uint8 that begin at a multiple of `_ALIGNMENT`."""
    whole = np.zeros(size + _ALIGNMENT, np.uint8)
    first = -whole.ctypes.data % _ALIGNMENT
    return whole[first : first + size]


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _function(library: Any, kind: str, name: str) -> Any:
    found = getattr(library, f"softgym_mj_{kind}_batch_{name}")
    found.restype = _RESULTS.get(name, ctypes.c_int)
    return found


def describe(
    kind: str, model: mujoco.MjModel, data: mujoco.MjData, ids: np.ndarray, *settings: Any
) -> np.ndarray:
    """What worlds of a kind have to know of a model, as bytes (size,) uint8.

    Args:
        kind: "cloth" or "fluid".
        model, data: what is to be stepped.
        ids: (n,) of what is told where to go.
        settings: further arguments of the library's function.

    Raises:
        InvalidArgumentError: if there is anything in it that cannot be stepped.
    """
    write = _function(ctypes.CDLL(str(load_plugin())), kind, "model")
    ids, error, out = np.ascontiguousarray(ids, np.int32), _aligned(_REASON), _aligned(0)
    for _ in range(2):  # Its size, then its content.
        size = write(
            ctypes.c_void_p(model._address), ctypes.c_void_p(data._address), _pointer(ids),
            len(ids), *settings, _pointer(out), len(out), _pointer(error), _REASON,
        )  # fmt: skip
        if not size:
            reason = error.tobytes().split(b"\0")[0].decode()
            raise InvalidArgumentError(f"model cannot be stepped in a batch: {reason}")
        out = out if len(out) == size else _aligned(size)
    return out


class Worlds:
    """The state of worlds, arrays with a row for each, and their steps.

    Worlds differ in size: rows have room for the largest model. A subclass names the state.

    Attributes:
        kind: of the library's functions.
        fields: shapes of the arrays, (num_worlds, size, ...), each an attribute of its name: the
            first number is the name of a size, or 1.
        flags: what went wrong so far, as bits (num_worlds,) int32.
    """

    kind: str
    fields: Mapping[str, tuple[str | int, *tuple[int, ...]]]

    def __init__(self, num_worlds: int, sizes: Mapping[str, int], num_threads: int, turns: int):
        """Worlds of zeros without models.

        Args:
            num_worlds: how many.
            sizes: of the largest model by name; all have as many of the last ones, which are told
                where to go.
            num_threads: that step worlds at a time.
            turns: in which order each part of a step is done, which changes no bit: for tests.
        """
        self._library: Any = ctypes.CDLL(str(load_plugin()))
        self._sizes, self._threads, self._turns = dict(sizes), num_threads, turns
        for name, shape in self.fields.items():
            setattr(self, name, np.zeros((num_worlds, self._size(shape[0], sizes), *shape[1:])))
        self.flags = np.zeros(num_worlds, np.int32)
        self._models: list[np.ndarray | None] = [None] * num_worlds
        self._scratch: list[np.ndarray | None] = [None] * num_worlds

    @staticmethod
    def _size(kind: str | int, sizes: Mapping[str, int]) -> int:
        return sizes[kind] if isinstance(kind, str) else kind

    def _counts(self, model: np.ndarray) -> dict[str, int]:
        """The sizes of a model, by name."""
        counts = np.zeros(len(self._sizes), np.int32)
        _function(self._library, self.kind, "counts")(_pointer(model), _pointer(counts))
        return dict(zip(self._sizes, counts.tolist(), strict=True))

    def start(self, i: int, model: np.ndarray) -> None:
        """Gives world `i` a model, from `describe`, and empties its rows.

        Raises:
            InvalidArgumentError: for a model that is larger than the rows.
        """
        counts, last = self._counts(model), next(reversed(self._sizes))
        fits = all(counts[name] <= most for name, most in self._sizes.items())
        if not fits or counts[last] != self._sizes[last]:
            raise InvalidArgumentError("model", counts, f"within {self._sizes}")
        needed = _function(self._library, self.kind, "scratch")(_pointer(model))
        scratch = self._scratch[i]
        if scratch is None or len(scratch) < needed:
            self._scratch[i] = _aligned(needed)
        else:
            scratch[:] = 0
        self._models[i] = model
        for name in self.fields:
            getattr(self, name)[i] = 0.0
        self.flags[i] = 0

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """The state of world `i` (n, ...) by name, for `set_state` of a world of the same model."""
        model = self._models[i]
        if model is None:
            raise LifecycleError(f"world {i} has no model yet: call start() before get_state()")
        counts = self._counts(model)
        return {
            name: getattr(self, name)[i, : self._size(kind, counts)].copy()
            for name, (kind, *_) in self.fields.items()
        }

    def set_state(self, i: int, state: Mapping[str, np.ndarray]) -> None:
        """Restores what `get_state` returned: what follows has the same bits."""
        for name, array in state.items():
            getattr(self, name)[i] = 0.0
            getattr(self, name)[i, : len(array)] = array

    def _step(self, *told: np.ndarray) -> None:
        """Makes a step of all worlds.

        Args:
            told: what they are told, in the order of `Batch` of the kind's batch/host.h.

        Raises:
            LifecycleError: if a world has no model yet.
        """
        models, scratch = (
            np.array([0 if array is None else array.ctypes.data for array in arrays], np.uint64)
            for arrays in (self._models, self._scratch)
        )
        if not models.all():
            raise LifecycleError("a world has no model yet: call start() before step()")
        state = (getattr(self, name) for name in self.fields)
        pointers = [a.ctypes.data for a in (models, scratch, *state, *told, self.flags)]
        # `Batch`: ints, an even number of them, then pointers.
        sizes = np.array([len(self.flags), *self._sizes.values()], np.int32)
        batch = np.concatenate([sizes.view(np.uint64), np.array(pointers, np.uint64)])
        step = _function(self._library, self.kind, "step")
        step(_pointer(batch), self._threads, self._turns)
