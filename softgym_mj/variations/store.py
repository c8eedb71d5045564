"""`VariationStore`: start states that are generated once by simulation and then stored.

It looks in the set shipped in the package, then in the user's cache, which has one file a
variation.
"""

import functools
import logging
from collections.abc import Callable, Iterable, Sequence

import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.exceptions import StoreError
from softgym_mj.native.caches import ADVICE, cache_folder
from softgym_mj.parallel.executors import BatchExecutor, Executor
from softgym_mj.storage.store import ARRAYS, Key, Store
from softgym_mj.variations import packs
from softgym_mj.variations.indices import Start, check_variation

# Results change between minor releases.
_MUJOCO_SERIES = ".".join(mujoco.__version__.split(".")[:2])

_log = logging.getLogger(__name__)
_NOTICE = (
    "Initial state %d of %s is not cached in %s; simulating it (under 1 s, crumpled cloth a few "
    "seconds). Run `softgym-mj generate TASK --jobs N` to precompute all 1000."
)


_MOST = 250  # Largest number of variations that are generated together.


def _together(start: Start, device: Device, calls: Sequence[tuple[int]]) -> list[np.ndarray]:
    return start.generate_all([index for (index,) in calls], device)


class VariationStore(Store):
    """Settled start states (n, 3) [m] by variation, generated if missing."""

    def __init__(self, start: Start):
        specification = {
            "initializer": start.name,
            "parameters": start.parameters,
            "mujoco": _MUJOCO_SERIES,
        }
        super().__init__(cache_folder(), specification, ARRAYS)
        self.folder /= f"{start.name}-{self.digest[:12]}"
        self._start = start

    def shipped(self) -> list[np.ndarray] | None:
        """Returns the states (n, 3) [m] that the package ships; None if it ships none of these."""
        return packs.shipped(self._start.name, self.text)

    def load(self, index: int) -> np.ndarray:
        """Returns vertices (n, 3) [m] of a variation; generates and stores them if missing.

        Raises:
            StoreError: if the file in the cache is truncated, altered, of another specification or
                of another variation; if it has to be generated and cannot be written.
        """
        index = check_variation(index)
        states = self.shipped()
        if states is not None:
            return states[index].copy()
        if not self.has(index):
            level = logging.INFO if self.is_empty() else logging.DEBUG  # Logged once for each task.
            _log.log(level, _NOTICE, index, self._start.name, self.folder)
            self.put(index, self._start.generate(index))
        return self.get(index)

    def get(self, key: Key) -> np.ndarray:
        """Returns vertices (n, 3) [m] of a variation in the cache; raises the errors of `Store`."""
        return super().get(key)["points"].astype(float)

    def put(self, key: Key, value: np.ndarray) -> None:
        """Stores vertices (n, 3) [m], in single precision.

        Raises:
            StoreError: if the file cannot be written.
        """
        try:
            super().put(key, {"points": value.astype(np.float32)})
        except StoreError as error:
            raise StoreError(f"{error}. {ADVICE}") from error

    def generate_missing(
        self,
        indices: Iterable[int],
        executor: Executor | None = None,
        progress: Callable[[int], None] = lambda index: None,
        device: Device | None = None,
    ) -> int:
        """Generates missing and corrupt states; may be interrupted and run again.

        Args:
            indices: variation indices.
            executor: executor that generates them, which does not affect the files; None for this
                process.
            progress: called with each index when its file exists.
            device: device that simulates many at once instead; the files are the same.

        Returns:
            Number of generated variations.
        """
        function: Callable = self._start.generate
        if device is not None:
            function = functools.partial(_together, self._start, device)
            executor = BatchExecutor(_MOST)
        return self.run(
            [check_variation(index) for index in indices],
            function,
            executor,
            lambda index, points: progress(index),
            replace=True,
        )
