"""`WaterWorlds`: the water of many worlds, stepped together without MuJoCo.

A world makes the same steps as the plugin in a model with one fluid and walls that stand still or
go where they are told: the same bits. The program is written for one thread or for a block of a
GPU.
"""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.native.arrays import aligned
from softgym_mj.native.library import load_plugin

MOST_WALLS = 32  # As in batch/model.h.
# What may go wrong in a step, as bits: numbers that are not finite; more neighbours of a particle
# than are listed, or more cells than there is room for; particles further than 100 m from others.
NOT_FINITE, TOO_MANY_NEIGHBORS, TOO_MANY_CELLS, SCATTERED = (1 << i for i in range(4))

_REASON = 256  # [characters]
ONE = "one"
_FIELDS: dict[str, tuple[Any, ...]] = {
    "known": (ONE,),
    "positions": ("particles", 3),
    "velocities": ("particles", 3),
    "walls": ("walls", 7),
}


class _Batch(ctypes.Structure):
    """`Batch` of batch/host.h."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("worlds", "most_particles", "most_walls", "bodies")),
        *((name, ctypes.c_void_p) for name in ("models", *_FIELDS, "poses", "scratch", "flags")),
    )


def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(load_plugin()))
    pointer, count = ctypes.c_void_p, ctypes.c_int
    library.softgym_mj_fluid_batch_model.argtypes = [
        pointer, pointer, pointer, count, pointer, ctypes.c_char_p, count,
    ]  # fmt: skip
    library.softgym_mj_fluid_batch_scratch.argtypes = [pointer]
    library.softgym_mj_fluid_batch_scratch.restype = ctypes.c_longlong
    library.softgym_mj_fluid_batch_counts.argtypes = [pointer, pointer]
    library.softgym_mj_fluid_batch_step.argtypes = [pointer, count, count]
    return library


def describe(model: mujoco.MjModel, bodies: Sequence[int]) -> np.ndarray:
    """What `WaterWorlds` have to know of a model, as bytes (size,) uint8.

    Args:
        model: with water that nothing feels.
        bodies: that are told where to go; other walls stand still.

    Raises:
        InvalidArgumentError: if there is anything else in it that the water touches.
    """
    library, error = _library(), ctypes.create_string_buffer(_REASON)
    data, told, out = mujoco.MjData(model), np.array(bodies, np.int32), None
    for _ in range(2):  # Its size, then its content.
        size = library.softgym_mj_fluid_batch_model(
            model._address, data._address, told.ctypes.data, len(told),
            None if out is None else out.ctypes.data, error, _REASON,
        )  # fmt: skip
        if not size:
            reason = error.value.decode()
            raise InvalidArgumentError(f"model cannot be stepped in a batch: {reason}")
        out = aligned(size) if out is None else out
    assert out is not None
    return out


class WaterWorlds:
    """The state of the water of worlds, arrays with a row for each, and their steps.

    Worlds differ in size: rows have room for the largest model.

    Attributes:
        positions, velocities: of particles (num_worlds, particles, 3) [m], [m/s].
        walls: positions [m] and quaternions of walls at the end of the last step (num_worlds,
            `MOST_WALLS`, 7), which are meant if `known` (num_worlds, 1) is not 0.
        flags: what went wrong so far, as bits (num_worlds,) int32.
    """

    known: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    walls: np.ndarray

    def __init__(
        self, num_worlds: int, particles: int, bodies: int, *, num_threads: int = 1, turns: int = 0
    ):
        """Worlds of zeros without models.

        Args:
            num_worlds: how many.
            particles: of the largest model.
            bodies: of each model, that are told where to go.
            num_threads: that step worlds at a time.
            turns: in which order each part of a step is done, which changes no bit: for tests.
        """
        self._library, self._threads, self._turns = _library(), num_threads, turns
        self._sizes = {"particles": particles, "walls": MOST_WALLS, "bodies": bodies}
        for name, (kind, *shape) in _FIELDS.items():
            setattr(self, name, np.zeros((num_worlds, {**self._sizes, ONE: 1}[kind], *shape)))
        self.flags = np.zeros(num_worlds, np.int32)
        self._models: list[np.ndarray | None] = [None] * num_worlds
        self._scratch: list[np.ndarray | None] = [None] * num_worlds

    def _counts(self, model: np.ndarray) -> dict[str, int]:
        """How many particles, walls and bodies a model has, by name."""
        counts = np.zeros(3, np.int32)
        self._library.softgym_mj_fluid_batch_counts(model.ctypes.data, counts.ctypes.data)
        return dict(zip(self._sizes, counts.tolist(), strict=True))

    def start(self, i: int, model: np.ndarray) -> None:
        """Gives world `i` a model, from `describe`, and empties its rows.

        Raises:
            InvalidArgumentError: for a model that is larger than the rows.
        """
        counts = self._counts(model)
        fits = all(counts[name] <= most for name, most in self._sizes.items())
        if not fits or counts["bodies"] != self._sizes["bodies"]:
            raise InvalidArgumentError("model", counts, f"within {self._sizes}")
        needed = self._library.softgym_mj_fluid_batch_scratch(model.ctypes.data)
        scratch = self._scratch[i]
        if scratch is None or len(scratch) < needed:
            self._scratch[i] = aligned(needed)
        self._models[i] = model
        for name in _FIELDS:
            getattr(self, name)[i] = 0.0
        self.flags[i] = 0

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """The state of world `i` (n, ...) by name, for `set_state` of a world of the same model."""
        model = self._models[i]
        if model is None:
            raise LifecycleError(f"world {i} has no model yet: call start() before get_state()")
        counts = {**self._counts(model), ONE: 1}
        return {
            name: getattr(self, name)[i, : counts[kind]].copy()
            for name, (kind, *_) in _FIELDS.items()
        }

    def set_state(self, i: int, state: Mapping[str, np.ndarray]) -> None:
        """Restores what `get_state` returned: what follows has the same bits."""
        for name, array in state.items():
            getattr(self, name)[i] = 0.0
            getattr(self, name)[i, : len(array)] = array

    def step(self, poses: np.ndarray) -> None:
        """Makes a step of all worlds.

        Args:
            poses: positions [m] and quaternions of bodies at its end (num_worlds, bodies, 7).

        Raises:
            LifecycleError: if a world has no model yet.
        """
        models, scratch = (
            np.array([0 if a is None else a.ctypes.data for a in arrays], np.uint64)
            for arrays in (self._models, self._scratch)
        )
        if not models.all():
            raise LifecycleError("a world has no model yet: call start() before step()")
        arrays = {
            "models": models, "scratch": scratch, "flags": self.flags,
            **{name: getattr(self, name) for name in _FIELDS},
            "poses": np.ascontiguousarray(poses, float),
        }  # fmt: skip
        batch = _Batch(
            worlds=len(self.flags),
            most_particles=self._sizes["particles"],
            most_walls=MOST_WALLS,
            bodies=self._sizes["bodies"],
            **{name: array.ctypes.data for name, array in arrays.items()},
        )
        self._library.softgym_mj_fluid_batch_step(ctypes.byref(batch), self._threads, self._turns)
