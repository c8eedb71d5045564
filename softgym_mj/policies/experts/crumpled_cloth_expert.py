"""`CrumpledClothExpert`: lays out a pile of cloth, then mends what lies wrong.

Pickers take two vertices of their choice, one after the other where the second one only shows when
the cloth is lifted. Hands of arms keep to their sides: they take what shows on these, both at once,
and lay out the cloth by that as well as it goes. The next time, more of it shows.
"""

import abc
import functools
import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from softgym_mj.native.arithmetic import length
from softgym_mj.policies.experts.cloth_expert import ClothExpert
from softgym_mj.policies.experts.rehearsing import GAIN, Plan, RehearsingExpert

# Takes what a round begins with, and sets the grips.
Take = Callable[[list[bool]], Iterator[np.ndarray]]

RANKS = (0, 1, 2)  # Of the exposed vertices near the wanted ones, which is taken first.
ALIKE = 3  # Grid steps up to which two holds are of a kind.
POOR = 0.4  # Normalized performance up to which it is moved in any case.


class CrumpledClothExpert(ClothExpert, RehearsingExpert):
    """Lays out a pile, then does it again or moves what lies wrong, as long as that is worth it.

    Attributes:
        redo: normalized performance up to which it may be laid out again.
        holds: how many holds arms try each time.
    """

    brakes = True
    redo: float
    holds: int

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
        return [functools.partial(self._round, take) for take in self._takes()]

    def _takes(self) -> list[Take]:
        """Ways to take it."""
        if self._has_arms:
            target = [dict(enumerate(hold)) for hold in self._holds()]
            return [functools.partial(self._take, w, away=math.inf) for w in target]
        choices = itertools.product(self._pairs(), RANKS)
        return [functools.partial(self._take_pair, pairs, rank=rank) for pairs, rank in choices]

    def _round(self, take: Take) -> Iterator[np.ndarray]:
        grips = [False, False]
        yield from take(grips)
        if all(grips) and self._actor.held.min() >= 0:  # One may have been torn away.
            yield from self._lay(grips)

    def _holds(self) -> list[tuple[int, int]]:
        """The best holds, each of another kind: vertices that both hands can take at once."""
        able = [[v for v in self._handles() if self._clearance(i, v) > 0.0] for i in range(2)]
        points = self._target.points()
        holds = [
            (a, b)
            for a, b in itertools.product(*able)
            if self._actor.order(points[[a, b]]) == [0, 1]
            and length(points[a] - points[b]) > self._actor.least_distance
        ]
        holds.sort(key=lambda hold: -self._hold_worth(*hold))
        chosen: list[tuple[int, int]] = []
        for a, b in holds:
            if all(max(self._steps(a, c), self._steps(b, d)) > ALIKE for c, d in chosen):
                chosen.append((a, b))
            if len(chosen) == self.holds:
                break
        return chosen

    @abc.abstractmethod
    def _handles(self) -> list[int]:
        """The vertices that it may be taken by."""

    @abc.abstractmethod
    def _hold_worth(self, a: int, b: int) -> float:
        """How well the cloth can be laid out that is held by two vertices, as a length [m]."""

    def _mends(self) -> list[Plan]:
        """Ways to put what lies far from its place there: two vertices or one of them."""
        placed = self._places()
        chosen = self._misplaced(placed)
        choices = [chosen, *([vertex] for vertex in chosen)] if len(chosen) == 2 else [chosen]
        return [functools.partial(self._put, vertices, placed) for vertices in choices if vertices]
