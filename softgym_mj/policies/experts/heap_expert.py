"""`HeapExpert`: lays out a heap of cloth, then mends what lies wrong."""

import abc
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.cloth_expert import PUT_STEPS, ClothExpert


class HeapExpert(ClothExpert):
    """Takes two vertices of a heap and lays it out, then moves what lies wrong to its place.

    Attributes:
        done: normalised performance from which the cloth is left alone.
        redo: the same, below which it is laid out again if time allows.
        round_steps: env steps that this needs at least.
    """

    done: float
    redo: float
    round_steps: int

    @abc.abstractmethod
    def _pairs(self) -> list[tuple[int, int, float]]:
        """Vertices that it may be taken by: (vertex, vertex, distance [m])."""

    @abc.abstractmethod
    def _lay(self, grips: list[bool]) -> Iterator[np.ndarray]:
        """Lays out the cloth that is held."""

    @abc.abstractmethod
    def _places(self) -> np.ndarray:
        """Where the vertices (n, 3) [m] ought to lie."""

    def _episode(self) -> Iterator[np.ndarray]:
        # Hands of arms stay on their sides, away from what the other one lifts: they only mend.
        lays, laid = not self._has_arms, False
        while True:
            score = self._env.task.info()["normalized_performance"]
            left = self._env.horizon - self._env.step_count
            if lays and (not laid or (score < self.redo and left > self.round_steps)):
                laid = True
                grips = [False, False]
                yield from self._take_pair(self._pairs(), grips)
                if all(grips) and self._actor.held.min() >= 0:  # One may have been torn away.
                    yield from self._lay(grips)
                continue
            mends = score < self.done and left > PUT_STEPS
            yield from self._mend(self._places()) if mends else self._wait()
