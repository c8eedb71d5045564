"""Searches by CMA-ES, several side by side, whose evaluations any executor makes."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.exceptions import check_count, import_extra
from softgym_mj.jobs.executors import Executor
from softgym_mj.jobs.journal import Journal
from softgym_mj.reality.identification.quadratic import coefficients, minimum
from softgym_mj.reality.identification.tasks import loss

Progress = Callable[[dict[Any, tuple[int, float]]], None]

POPULATION = 12
EVALUATIONS = 300
# Of a generation that are least points of quadratics, once there are evaluations for them: where a
# loss is smooth, some tens of these save hundreds of others (as in lq-CMA-ES; Hansen, 2019).
_GUESSES = 6
_SIGMA = 0.6  # Of coordinates, at first.
# A generation whose losses differ by less than this share has nothing to choose from.
_TOLERANCE = 5e-4


@dataclasses.dataclass(frozen=True)
class Found:
    """What a search has looked at.

    Attributes:
        estimate: (unknowns,) coordinates where it ended.
        points: (n, unknowns) coordinates.
        frames: (n, ...) distances [m] of all frames of all recordings, one after the other.
        losses: (n,) [m].
    """

    estimate: np.ndarray
    points: np.ndarray
    frames: np.ndarray
    losses: np.ndarray


class Search:
    """One search: asks for evaluations and is told of them, a generation at a time."""

    def __init__(
        self,
        start: np.ndarray,
        bounds: np.ndarray,
        shares: Sequence[float],
        seed: int,
        evaluations: int = EVALUATIONS,
        population: int = POPULATION,
    ):
        """Starts at coordinates (unknowns,) within bounds (unknowns, 2).

        Args:
            start, bounds: coordinates.
            shares: of recordings in the loss, as of `tasks.weights`.
            seed: of its random numbers.
            evaluations: how many it may ask for.
            population: of a generation.

        Raises:
            InvalidArgumentError: for fewer evaluations than a generation.
            UnavailableError: without the package `cmaes`.
        """
        check_count("evaluations", evaluations, population)
        cmaes = import_extra("cmaes", "cmaes", "reality")
        inside = np.clip(start, bounds[:, 0] + 1e-6, bounds[:, 1] - 1e-6)
        self._cma = cmaes.CMA(
            mean=inside, sigma=_SIGMA, bounds=bounds, seed=seed, population_size=population
        )
        self._shares = tuple(shares)
        self._left = evaluations // population
        self._best = 2 * coefficients(len(start))
        self._points: list[np.ndarray] = []
        self._frames: list[list[float]] = []
        self._losses: list[float] = []

    @property
    def is_done(self) -> bool:
        """Whether it asks for nothing more."""
        return self._left == 0

    @property
    def made(self) -> tuple[int, float]:
        """How many evaluations it has been told of, and their least loss [m]."""
        return len(self._losses), min(self._losses, default=math.inf)

    def ask(self) -> list[np.ndarray]:
        """Coordinates (unknowns,) of the next generation; the same until it is told of them."""
        if len(self._points) == len(self._losses):
            guesses = self._guesses()
            drawn = self._cma.population_size - len(guesses)
            self._points += [*(self._cma.ask() for _ in range(drawn)), *guesses]
        return self._points[len(self._losses) :]

    def tell(self, frames: Sequence[list[list[float]]]) -> None:
        """Takes the distances [m] of frames of recordings at each of what was asked for."""
        losses = [loss(each, self._shares) for each in frames]
        asked = self.ask()
        self._cma.tell(list(zip(asked, losses, strict=True)))
        self._losses += losses
        self._frames += [list(itertools.chain(*each)) for each in frames]
        spread = max(losses) - min(losses)
        self._left = 0 if spread < _TOLERANCE * min(losses) else self._left - 1

    def _guesses(self) -> list[np.ndarray]:
        """Where quadratics through the best evaluations are least, within what these span."""
        best = np.argsort(self._losses, kind="stable")[: self._best]
        if len(best) < self._best:
            return []
        points, losses = np.array(self._points)[best], np.array(self._losses)[best]
        low, high = points.min(axis=0), points.max(axis=0)
        random = np.random.default_rng(len(self._losses))
        rows = [np.arange(len(best))]
        rows += [random.integers(0, len(best), len(best)) for _ in range(_GUESSES - 1)]
        span = np.column_stack([low, high])
        return [minimum(points[some], losses[some], span) for some in rows]

    def found(self) -> Found:
        """What it has looked at."""
        return Found(
            np.array(self._cma.mean),
            np.array(self._points[: len(self._losses)]),
            np.array(self._frames),
            np.array(self._losses),
        )


def together(
    searches: Mapping[Any, Search],
    call: Callable[[Any, tuple[float, ...]], tuple],
    function: Callable[..., list[list[float]]],
    executor: Executor,
    journals: Mapping[Any, Journal] | None = None,
    progress: Progress = lambda made: None,
) -> None:
    """Advances searches to their ends, a generation of all of them at a time.

    Args:
        searches: by key.
        call: the arguments of `function` for a search's key and coordinates.
        function: gives distances of frames of recordings.
        executor: that makes these calls.
        journals: of the same keys; generations that they have are not made again.
        progress: told, after every generation, of each search how many evaluations it has made and
            their least loss [m].
    """
    journals = journals or {}
    for key, journal in journals.items():
        for generation in journal.read():
            searches[key].ask()
            searches[key].tell(generation)
    while running := {key: search for key, search in searches.items() if not search.is_done}:
        asked = {key: search.ask() for key, search in running.items()}
        calls = [call(key, tuple(map(float, x))) for key, xs in asked.items() for x in xs]
        results = iter(executor.all(function, calls))
        for key, xs in asked.items():
            generation = [next(results) for _ in xs]
            if key in journals:
                journals[key].append(generation)
            running[key].tell(generation)
        progress({key: search.made for key, search in searches.items()})
