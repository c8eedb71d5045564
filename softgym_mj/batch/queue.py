"""`Queue`: in which order the blocks of a GPU take environments: see queue.h."""

from typing import Any

import numpy as np

from softgym_mj.batch.device import Device


class Queue:
    """The longest first: in the end few wait for one.

    Attributes:
        arrays: for a `Batch`, in this order: how many have been begun (1,) int32, in which order
            environments are (num_envs,) int32, and what each took the last time (num_envs,) int64
            [cycles].
    """

    def __init__(self, num_envs: int, device: Device):
        """Orders environments by their index at first."""
        self._device = device
        order = device.put(np.arange(num_envs, dtype=np.int32))
        zeros = device.zeros((1,), "int32"), device.zeros((num_envs,), "int64")
        self.arrays: tuple[Any, Any, Any] = (zeros[0], order, zeros[1])

    def plan(self) -> None:
        """Orders them by what they took."""
        xp, (_, order, cost) = self._device.xp, self.arrays
        order[...] = xp.astype(xp.argsort(-cost), order.dtype)

    def begin(self) -> None:
        """Has all be taken once more."""
        self.arrays[0][...] = 0
