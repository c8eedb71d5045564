"""`DeviceRollouts`: returns of many action sequences, simulated together on a device."""

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
    """Rollouts for a planner as a batch on a device; implements `policies.rollouts.Rollouts`."""

    def __init__(
        self,
        task: str | TaskRecord,
        settings: Mapping[str, object],
        device: str,
        variations: Sequence[int] = (),
    ):
        """Chooses task and device.

        Args:
            task: Task name or record; a name is resolved at once.
            settings: Keyword arguments of the task.
            device: "host" or "cuda", as in `vector.make_vec`.
            variations: Variations to come. Arrays are padded for the largest so far, and padding
                changes the last bits of sums: with all variations given here, returns do not
                depend on which are simulated together.
        """
        arguments: dict[str, Any] = {"observation": "reduced", **settings}
        self._make = functools.partial(SoftGymEnv, registry.find(task), split="all", **arguments)
        self._device, self._variations = device, variations
        self._backends: dict[int, BatchBackend] = {}  # The last one, by number of environments.

    def returns(self, snapshot: Snapshot, sequences: np.ndarray) -> np.ndarray:
        """Returns undiscounted returns (n,) of action sequences (n, horizon, size) from a state."""
        return self.all([(snapshot, sequences)])[0]

    def all(self, trials: Sequence[tuple[Snapshot, np.ndarray]]) -> list[np.ndarray]:
        """Returns the returns of each trial; all sequences have the same horizon."""
        ends = np.cumsum([len(sequences) for _, sequences in trials])
        number = int(ends[-1])
        if number not in self._backends:
            self._backends.clear()  # First: two need twice the memory.
            self._backends[number] = self._backend(number)
        return np.split(self._backends[number].replay(trials), ends[:-1])

    def _backend(self, number: int) -> BatchBackend:
        """Makes a backend of `number` environments with room for all variations."""
        backend = BatchBackend(self._make(), number, make_device(self._device, number))
        several = itertools.cycle(self._variations)
        for _ in range(0, len(self._variations), number):
            backend.reset(dict(zip(range(number), several, strict=False)))
        return backend
