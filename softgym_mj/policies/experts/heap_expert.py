"""`HeapExpert`: lays out a heap of cloth, then mends what lies wrong."""

import abc
import functools
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.cloth_expert import ClothExpert
from softgym_mj.policies.experts.rehearsing import GAIN, Plan, RehearsingExpert

RANKS = (0, 1, 2)  # Of the exposed vertices near the wanted ones, which is taken first.
POOR = 0.4  # Normalised performance up to which it is moved in any case.


class HeapExpert(ClothExpert, RehearsingExpert):
    """Lays out a heap, then does it again or moves what lies wrong, as long as that is worth it.

    Attributes:
        redo: normalised performance up to which it may be laid out again.
    """

    redo: float

    @abc.abstractmethod
    def _pairs(self) -> list[list[tuple[int, int, float]]]:
        """Choices of vertices that it may be taken by: (vertex, vertex, distance [m])."""

    @abc.abstractmethod
    def _lay(self, grips: list[bool]) -> Iterator[np.ndarray]:
        """Lays out the cloth that is held."""

    @abc.abstractmethod
    def _places(self) -> np.ndarray:
        """Where the vertices (n, 3) [m] ought to lie."""

    def _episode(self) -> Iterator[np.ndarray]:
        while True:
            value = self._value()
            plans = self._mends() + (self._rounds() if value < self.redo else [])
            outcomes = self._outcomes(plans)
            if not plans or (value > POOR and outcomes.max() < value + GAIN):
                break
            yield from plans[outcomes.argmax()]()
        yield from self._wait()

    def _rounds(self) -> list[Plan]:
        """Ways to lay it out."""
        # Hands of arms stay on their sides, away from what the other one lifts: they only mend.
        if self._has_arms:
            return []
        return [
            functools.partial(self._round, pairs, rank) for pairs in self._pairs() for rank in RANKS
        ]

    def _round(self, pairs: list[tuple[int, int, float]], rank: int) -> Iterator[np.ndarray]:
        grips = [False, False]
        yield from self._take_pair(pairs, grips, rank)
        if all(grips) and self._actor.held.min() >= 0:  # One may have been torn away.
            yield from self._lay(grips)

    def _mends(self) -> list[Plan]:
        """Ways to put what lies far from its place there: two vertices or one of them."""
        placed = self._places()
        chosen = self._misplaced(placed)
        choices = [chosen, *([vertex] for vertex in chosen)] if len(chosen) == 2 else [chosen]
        return [functools.partial(self._put, vertices, placed) for vertices in choices if vertices]
