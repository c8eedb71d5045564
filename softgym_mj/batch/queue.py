"""`Queue`: order in which the blocks of a GPU step environments (queue.h)."""

from typing import Any

import numpy as np

from softgym_mj.batch.device import Device


class Queue:
    """Orders environments by duration, the longest first, so that few blocks wait at the end.

    Attributes:
        arrays: Arrays of the C++ struct `Batch`: number of environments begun (1,) int32, order of
            environments (num_envs,) int32, and duration of each last step (num_envs,) int64
            [cycles].
    """

    def __init__(self, num_envs: int, device: Device):
        """Orders environments by their index at first."""
        self._device = device
        order = device.put(np.arange(num_envs, dtype=np.int32))
        zeros = device.zeros((1,), "int32"), device.zeros((num_envs,), "int64")
        self.arrays: tuple[Any, Any, Any] = (zeros[0], order, zeros[1])

    def plan(self) -> None:
        """Sorts environments by the duration of their last step."""
        xp, (_, order, cost) = self._device.xp, self.arrays
        order[...] = xp.astype(xp.argsort(-cost), order.dtype)

    def begin(self) -> None:
        """Restarts the queue."""
        self.arrays[0][...] = 0
