"""`CrumpledClothExpert`: lays out crumpled cloth, then moves misplaced vertices.

Pickers grasp two chosen vertices, one after the other if the second one is only exposed when the
cloth is lifted. Hands of arms stay on their sides: they grasp exposed vertices there at the same
time and lay out the cloth as far as possible, which exposes more of it for the next round.
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

# Grasps the cloth at the start of a round and sets the grips.
Take = Callable[[list[bool]], Iterator[np.ndarray]]

RANKS = (0, 1, 2)  # Ranks, by distance, of the exposed vertex that is grasped first.
ALIKE = 3  # Grid steps up to which two holds count as the same.
POOR = 0.4  # Normalized performance up to which the cloth is moved in any case.


class CrumpledClothExpert(ClothExpert, RehearsingExpert):
    """Lays out crumpled cloth, repeats this or moves misplaced vertices while the score improves.

    Attributes:
        redo: Normalized performance up to which the cloth may be laid out again.
        holds: Number of holds that arms try in each round.
    """

    brakes = True
    redo: float
    holds: int

    @abc.abstractmethod
    def _pairs(self) -> list[list[tuple[int, int, float]]]:
        """Returns candidate pairs for a hold: (vertex, vertex, distance [m])."""

    @abc.abstractmethod
    def _lay(self, grips: list[bool]) -> Iterator[np.ndarray]:
        """Lays out the held cloth."""

    @abc.abstractmethod
    def _places(self) -> np.ndarray:
        """Returns the target positions (n, 3) [m] of the vertices."""

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
        """Returns plans that lay out the cloth."""
        return [functools.partial(self._round, take) for take in self._takes()]

    def _takes(self) -> list[Take]:
        """Returns ways to grasp the cloth."""
        if self._has_arms:
            target = [dict(enumerate(hold)) for hold in self._holds()]
            return [functools.partial(self._take, w, away=math.inf) for w in target]
        choices = itertools.product(self._pairs(), RANKS)
        return [functools.partial(self._take_pair, pairs, rank=rank) for pairs, rank in choices]

    def _round(self, take: Take) -> Iterator[np.ndarray]:
        grips = [False, False]
        yield from take(grips)
        if all(grips) and self._actor.held.min() >= 0:  # A vertex may have been torn away.
            yield from self._lay(grips)

    def _holds(self) -> list[tuple[int, int]]:
        """Returns the best different holds: vertices that both hands can grasp at once."""
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
        """Returns the vertices that may be grasped."""

    @abc.abstractmethod
    def _hold_worth(self, a: int, b: int) -> float:
        """Returns how well the cloth can be laid out from two held vertices, as a length [m]."""

    def _mends(self) -> list[Plan]:
        """Returns plans that move one or two misplaced vertices to their places."""
        placed = self._places()
        chosen = self._misplaced(placed)
        choices = [chosen, *([vertex] for vertex in chosen)] if len(chosen) == 2 else [chosen]
        return [functools.partial(self._put, vertices, placed) for vertices in choices if vertices]
