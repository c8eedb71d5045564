"""`DeviceRollouts`: returns of many action sequences, played together on a device."""

import functools
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj import registry
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.envs.snapshots import Snapshot
from softgym_mj.registry import TaskRecord
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.make import make_device


class DeviceRollouts:
    """All at once, as rows of arrays on a device, for a planner.

    These are `policies.rollouts.Rollouts`; for the devices see `vector.make_vec`.
    """

    def __init__(
        self,
        task: str | TaskRecord,
        settings: Mapping[str, object],
        device: str,
        variations: Sequence[int] = (),
    ):
        """Chooses what is played.

        Args:
            task: task name or record: what is registered now, whatever replaces it later.
            settings: keyword arguments of the task.
            device: "host" or "cuda".
            variations: those that will be played. Arrays are padded for the largest so far, which
                changes the last bits of sums: told of all from the start, returns never depend on
                which are played together.
        """
        arguments: dict[str, Any] = {"observation": "reduced", **settings}
        self._make = functools.partial(SoftGymEnv, registry.find(task), split="all", **arguments)
        self._device, self._variations = device, variations
        self._backends: dict[int, BatchBackend] = {}  # The last one, by its number of environments.

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        """Undiscounted returns (n,) of action sequences (n, horizon, size) from a state."""
        return self.all([(snapshot, sequences)])[0]

    def all(self, trials: Sequence[tuple[Snapshot, np.ndarray]]) -> list[np.ndarray]:
        """The returns of each of some trials, whose horizon is the same."""
        ends = np.cumsum([len(sequences) for _, sequences in trials])
        number = int(ends[-1])
        if number not in self._backends:
            self._backends.clear()  # First: two need twice the memory.
            self._backends[number] = self._backend(number)
        return np.split(self._backends[number].replay(trials), ends[:-1])

    def _backend(self, number: int) -> BatchBackend:
        """So many environments, with room for all variations."""
        backend = BatchBackend(self._make(), number, make_device(self._device, number))
        several = itertools.cycle(self._variations)
        for _ in range(0, len(self._variations), number):
            backend.reset(dict(zip(range(number), several, strict=False)))
        return backend
