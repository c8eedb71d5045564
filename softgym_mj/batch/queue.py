"""`Queue`: in which order the blocks of a GPU take environments: see queue.h."""

from typing import Any

import numpy as np

from softgym_mj.batch.places import Place


class Queue:
    """The longest first: in the end few wait for one.

    Attributes:
        arrays: for a `Batch`, in this order: how many have been begun (1,) int32, in which order
            environments are (num_envs,) int32, and what each took the last time (num_envs,) int64
            [cycles].
    """

    def __init__(self, num_envs: int, place: Place):
        """Environments as they are counted, in a place."""
        self._place = place
        order = place.put(np.arange(num_envs, dtype=np.int32))
        zeros = place.zeros((1,), "int32"), place.zeros((num_envs,), "int64")
        self.arrays: tuple[Any, Any, Any] = (zeros[0], order, zeros[1])

    def plan(self) -> None:
        """Orders them by what they took."""
        xp, (_, order, cost) = self._place.xp, self.arrays
        order[...] = xp.astype(xp.argsort(-cost), order.dtype)

    def begin(self) -> None:
        """Has all be taken once more."""
        self.arrays[0][...] = 0
