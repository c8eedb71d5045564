"""`NextEpisodes`: what follows episodes that end, told ahead to a device that nobody waits for."""

from collections import deque

import numpy as np

from softgym_mj.batch.device import Copy
from softgym_mj.vector.variation_sampler import VariationSampler

_MOST_BEHIND = 8  # Env steps that a device may be behind this process.


class NextEpisodes:
    """The variation that each environment plays next, and how often such a one has been begun.

    The device counts that; what it counts is read some steps later. Until then an environment whose
    episode ends once more would begin the same variation again.
    """

    def __init__(self, number: int):
        """Nothing has been offered.

        Args:
            number: of environments.
        """
        self._offered = [-1] * number
        self._used = np.zeros(number, int)  # As far as it is known.
        self._behind: deque[Copy] = deque()

    def changed(self, sampler: VariationSampler) -> dict[int, int]:
        """What is to be offered anew: variations by number of the environment."""
        while self._behind and (self._behind[0].done or len(self._behind) > _MOST_BEHIND):
            self._note(self._behind.popleft().wait(), sampler)
        upcoming = [sampler.upcoming(i) for i in range(len(self._offered))]
        before, self._offered = self._offered, upcoming
        return {i: new for i, new in enumerate(upcoming) if new != before[i]}

    def follow(self, used: Copy) -> None:
        """Takes note of how many offers each has used (number,), on its way here."""
        self._behind.append(used)

    def settle(self, used: np.ndarray, sampler: VariationSampler) -> None:
        """Takes note of how many offers each has used by now (number,)."""
        self._behind.clear()
        self._note(used, sampler)

    def _note(self, used: np.ndarray, sampler: VariationSampler) -> None:
        for i in np.flatnonzero(used > self._used).tolist():
            sampler.next(i)
        self._used = used
