"""`Worlds`: many flexes with grippers over a floor, stepped together without MuJoCo.

A world makes the same steps as the plugin in a model with one flex, spheres that are told where to
go, and a plane: the same bits. The program is written for one thread or for a block of a GPU.
"""

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.native.arrays import ALIGNMENT, aligned
from softgym_mj.native.library import load_plugin

KEPT_PAIRS = 2  # As in batch/world.h.
EDGES_OF_VERTEX = 3  # At most, of surfaces.
# What may go wrong in a step, as bits: numbers that are not finite; and no room for all candidates,
# pairs, rows or levels, so that some contacts were left out.
NOT_FINITE, CANDIDATES_FULL, PAIRS_FULL, ROWS_FULL, LEVELS_FULL = (1 << i for i in range(5))

_REASON = 256  # [characters]
ONE = "one"
_FIELDS: dict[str, tuple[Any, ...]] = {
    "valid": (ONE,),
    "qpos": ("vertices", 3),
    "qvel": ("vertices", 3),
    "reference": ("vertices", 3),
    "after_edge": ("edges",),
    "holding_force": ("vertices",),
    "after_layers": ("vertices", KEPT_PAIRS, 4),
    "gripper_qpos": ("grippers", 3),
    "gripper_qvel": ("grippers", 3),
}


class _Batch(ctypes.Structure):
    """`Batch` of batch/host.h."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("worlds", "grippers", "vertices", "edges")),
        *((name, ctypes.c_void_p) for name in ("models", *_FIELDS, "scratch")),
        ("scratch_size", ctypes.c_longlong),
        *((name, ctypes.c_void_p) for name in ("targets", "goals", "held", "flags")),
    )


def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(load_plugin()))
    pointer, count = ctypes.c_void_p, ctypes.c_int
    library.softgym_mj_cloth_batch_model.argtypes = [
        pointer, pointer, pointer, count, ctypes.c_double,
        pointer, count, ctypes.c_char_p, count,
    ]  # fmt: skip
    library.softgym_mj_cloth_batch_scratch.argtypes = [pointer]
    library.softgym_mj_cloth_batch_scratch.restype = ctypes.c_longlong
    library.softgym_mj_cloth_batch_counts.argtypes = [pointer, pointer]
    library.softgym_mj_cloth_batch_step.argtypes = [pointer, count, count]
    return library


def describe(model: mujoco.MjModel, grippers: Sequence[int], room: float = 1.0) -> np.ndarray:
    """What `Worlds` have to know of a model, as bytes (size,) uint8.

    Args:
        model: with one flex that the plugin moves, over a plane.
        grippers: geoms that are told where to go, all alike: spheres.
        room: for contacts, as a share of what suits heaps.

    Raises:
        InvalidArgumentError: if there is anything else in it that the flex touches.
    """
    library, error = _library(), ctypes.create_string_buffer(_REASON)
    geoms = np.array(grippers, np.int32)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)  # From then on the plugin knows it.
    out = aligned(0)
    for _ in range(2):  # Its size, then its content.
        size = library.softgym_mj_cloth_batch_model(
            model._address, data._address, geoms.ctypes.data, len(geoms), room,
            out.ctypes.data, len(out), error, _REASON,
        )  # fmt: skip
        if not size:
            raise InvalidArgumentError(
                f"model cannot be stepped in a batch: {error.value.decode()}"
            )
        out = out if len(out) == size else aligned(size)
    return out


class Worlds:
    """The state of worlds, arrays with a row for each, and their steps.

    Worlds differ in size: rows have room for the largest model.

    Attributes:
        qpos, qvel: of slides of vertices (num_worlds, vertices, 3) [m], [m/s].
        gripper_qpos, gripper_qvel: of grippers (num_worlds, grippers, 3) [m], [m/s].
        holding_force: with which its edges pulled a vertex that was held, mean of the last step
            (num_worlds, vertices) [N].
        valid: 1 of worlds that have made a step from where they are (num_worlds, 1); to be set to 0
            after vertices have been placed.
        reference, after_edge, after_layers: by which a step depends on those before it, as the
            state of the plugin.
        flags: what went wrong so far, as bits (num_worlds,) int32.
    """

    valid: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    reference: np.ndarray
    after_edge: np.ndarray
    holding_force: np.ndarray
    after_layers: np.ndarray
    gripper_qpos: np.ndarray
    gripper_qvel: np.ndarray

    def __init__(
        self, num_worlds: int, vertices: int, grippers: int, *, num_threads: int = 1, turns: int = 0
    ):
        """Worlds of zeros without models.

        Args:
            num_worlds: how many.
            vertices: of the largest model.
            grippers: of each model.
            num_threads: that step worlds at a time.
            turns: in which order each part of a step is done, which changes no bit: for tests.
        """
        self._library, self._threads, self._turns = _library(), num_threads, turns
        sizes = {"vertices": vertices, "edges": EDGES_OF_VERTEX * vertices, "grippers": grippers}
        for name, (kind, *shape) in _FIELDS.items():
            setattr(self, name, np.zeros((num_worlds, {**sizes, ONE: 1}[kind], *shape)))
        self.flags = np.zeros(num_worlds, np.int32)
        self._sizes = sizes
        self._models: list[np.ndarray | None] = [None] * num_worlds
        self._addresses = np.zeros(num_worlds, np.uint64)
        self._scratch = aligned(0).reshape(1, 0)

    def _counts(self, model: np.ndarray) -> dict[str, int]:
        """How many vertices, edges and grippers a model has, by name."""
        counts = np.zeros(3, np.int32)
        self._library.softgym_mj_cloth_batch_counts(model.ctypes.data, counts.ctypes.data)
        return dict(zip(self._sizes, counts.tolist(), strict=True))

    def start(self, i: int, model: np.ndarray) -> None:
        """Gives world `i` a model, from `describe`, and empties its rows.

        Raises:
            InvalidArgumentError: for a model that is larger than the rows.
        """
        counts = self._counts(model)
        fits = all(counts[name] <= most for name, most in self._sizes.items())
        if not fits or counts["grippers"] != self._sizes["grippers"]:
            raise InvalidArgumentError("model", counts, f"within {self._sizes}")
        self._models[i], self._addresses[i] = model, model.ctypes.data
        needed = self._library.softgym_mj_cloth_batch_scratch(model.ctypes.data)
        if needed > self._scratch.shape[1]:
            size = -(-needed // ALIGNMENT) * ALIGNMENT
            self._scratch = aligned(size * len(self.flags)).reshape(-1, size)
        self._scratch[i] = 0
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

    def step(self, targets: np.ndarray, held: np.ndarray, goals: np.ndarray) -> None:
        """Makes a step of all worlds.

        Args:
            targets: where grippers go (num_worlds, grippers, 3) [m].
            held: the vertex that each holds, or less than 0 (num_worlds, grippers).
            goals: where these go (num_worlds, grippers, 3) [m].

        Raises:
            LifecycleError: if a world has no model yet.
        """
        if not self._addresses.all():
            raise LifecycleError("a world has no model yet: call start() before step()")
        arrays = {
            "models": self._addresses, "scratch": self._scratch,
            **{name: getattr(self, name) for name in _FIELDS},
            "targets": np.ascontiguousarray(targets, float),
            "goals": np.ascontiguousarray(goals, float),
            "held": np.ascontiguousarray(held, np.int32), "flags": self.flags,
        }  # fmt: skip
        batch = _Batch(
            worlds=len(self.flags),
            **self._sizes,
            scratch_size=self._scratch.shape[1],
            **{name: array.ctypes.data for name, array in arrays.items()},
        )
        self._library.softgym_mj_cloth_batch_step(ctypes.byref(batch), self._threads, self._turns)
