"""`NextEpisodes`: next variations, prepared on a device without waiting for it."""

from collections import deque

import numpy as np

from softgym_mj.batch.device import Copy
from softgym_mj.vector.variation_sampler import VariationSampler

_MOST_BEHIND = 8  # Env steps that the device may lag behind this process.


class NextEpisodes:
    """Next variation of each environment, and the number of prepared episodes it has started.

    The device counts starts, and the count is read some steps later. Until then an environment
    whose episode ends again starts the same variation again.
    """

    def __init__(self, number: int):
        """Begins without prepared episodes.

        Args:
            number: Number of environments.
        """
        self._offered = [-1] * number
        self._used = np.zeros(number, int)  # Last counts read.
        self._behind: deque[Copy] = deque()

    def changed(self, sampler: VariationSampler) -> dict[int, int]:
        """Returns new next variations by index of the environment."""
        while self._behind and (self._behind[0].done or len(self._behind) > _MOST_BEHIND):
            self._note(self._behind.popleft().wait(), sampler)
        upcoming = [sampler.upcoming(i) for i in range(len(self._offered))]
        before, self._offered = self._offered, upcoming
        return {i: new for i, new in enumerate(upcoming) if new != before[i]}

    def follow(self, used: Copy) -> None:
        """Appends counts of started episodes (number,) that are being copied from the device."""
        self._behind.append(used)

    def settle(self, used: np.ndarray, sampler: VariationSampler) -> None:
        """Applies the current counts of started episodes (number,)."""
        self._behind.clear()
        self._note(used, sampler)

    def _note(self, used: np.ndarray, sampler: VariationSampler) -> None:
        for i in np.flatnonzero(used > self._used).tolist():
            sampler.next(i)
        self._used = used
