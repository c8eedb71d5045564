"""Least-squares searches that run side by side; any executor makes their evaluations.

A search draws points around its start and continues from the best one by trust-region steps. If
these do not reach residuals near zero, it draws points around its estimate, fits a quadratic
surface to their residuals and moves to the minimum of that surface, several times; then it tries
steps once more. Finally, an evaluation on a finer mesh shifts the surface.

SciPy's optimizer calls the function that it minimizes. A search has the ask-and-tell interface
instead, so that other processes can evaluate: the optimizer is rerun from its start on all known
evaluations until it needs one that is missing.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from softgym_mj.exceptions import check_count
from softgym_mj.parallel.executors import Executor
from softgym_mj.reality.identification.surface import Surface
from softgym_mj.storage.journal import Journal

Progress = Callable[[dict[Any, tuple[int, float]]], None]
Residuals = Sequence[Sequence[float]]  # [m] One sequence for each frame.

DRAWN = 12  # Points, including the start.
AROUND, ROUNDS = 36, 3  # Points drawn around an estimate, and the number of rounds.
EVALUATIONS = 240
_AGAIN = 30  # Evaluations of the last steps: with data of the same mesh they converge.
_SIGMA, _NEARER = 0.6, 0.3  # Standard deviations of drawn coordinates, first and later.
_APART = 0.1  # Step of the finite differences, in coordinates.
# [m] Weight of a residual that pulls each coordinate to the start: what no frame determines stays
# there.
_REGULARIZATION = 2e-5
_SCALE = 1.5e-3  # [m] Residuals above this count linearly, not squared (soft L1).
# Relative decrease of the squared loss below which steps end: smaller ones follow its roughness. On
# another mesh than that of the data they would go on to five times the bending stiffness.
_TOLERANCE = 0.1
_STEP_TOLERANCE = 1e-4  # Length of a step relative to that of all coordinates, which is about 15.
_MET = 3e-4  # [m] Loss below which more evaluations tell nothing.


@dataclasses.dataclass(frozen=True)
class SearchResult:
    """State of a search.

    Attributes:
        estimate: (unknowns,) coordinates.
        loss: least loss of all evaluations [m].
        evaluations: number of evaluations.
        residuals: (n,) at the estimate or near it, divided by their noise if that is known.
        jacobian: (n, unknowns) of these residuals.
        frames: (n,) frame of each residual.
        spurious: (unknowns, unknowns) expected value of the Jacobian's product with itself by
            chance.
    """

    estimate: np.ndarray
    loss: float
    evaluations: int
    residuals: np.ndarray
    jacobian: np.ndarray
    frames: np.ndarray
    spurious: np.ndarray


def loss(residuals: np.ndarray) -> float:
    """Returns the root mean square [m] of residuals, of which large ones count linearly."""
    squares = (residuals / _SCALE) ** 2
    return float(_SCALE * np.sqrt(np.mean(2.0 * (np.sqrt(1.0 + squares) - 1.0))))


class _Unknown(Exception):
    """Signals that evaluations at `points` are missing."""

    def __init__(self, points: list[np.ndarray]):
        super().__init__(points)
        self.points = points


class Search:
    """One search with an ask-and-tell interface, a generation at a time.

    Attributes:
        is_finer: whether the next generation is evaluated on the finer mesh.
    """

    def __init__(
        self,
        start: np.ndarray,
        bounds: np.ndarray,
        seed: int,
        evaluations: int = EVALUATIONS,
        refinements: int = 0,
    ):
        """Starts at coordinates (unknowns,) within bounds (unknowns, 2).

        Args:
            start, bounds: coordinates.
            seed: seed of the drawn points.
            evaluations: largest number of evaluations.
            refinements: largest number of further evaluations on a finer mesh.

        Raises:
            InvalidArgumentError: for fewer evaluations than one step and all rounds take.
        """
        fewest = DRAWN + len(start) + 1 + AROUND * ROUNDS + _AGAIN
        self._most = check_count("evaluations", evaluations, fewest)
        self._steps = evaluations - AROUND * ROUNDS - _AGAIN
        self._bounds, self._random = bounds, np.random.default_rng(seed)
        self._start = self._inside(start)
        self._points: list[np.ndarray] = []
        self._known: dict[bytes, np.ndarray] = {}
        self._losses: list[float] = []
        self._frames = np.array([], int)
        self._rounds, self._is_round = 0, False
        self._refinements, self.is_finer = refinements, False
        self._surface: Surface | None = None
        # Start of the last steps; None for the best drawn point.
        self._first: np.ndarray | None = None
        self._estimate, self._last = self._start, (np.zeros(0), np.zeros((0, len(start))))
        self._spurious = np.zeros((len(start), len(start)))
        self._asked = [self._start, *self._drawn(self._start, _SIGMA, DRAWN - 1)]

    @property
    def is_done(self) -> bool:
        """Whether the search asks for nothing more."""
        return not self._asked

    @property
    def made(self) -> tuple[int, float]:
        """Number of evaluations so far, and their least loss [m]."""
        return len(self._losses), min(self._losses, default=math.inf)

    def ask(self) -> list[np.ndarray]:
        """Returns coordinates (unknowns,) of the next generation, the same until `tell`."""
        return self._asked

    def tell(self, found: Sequence[Residuals]) -> None:
        """Takes the residuals [m] of all frames at each of the points asked for."""
        if self.is_finer:
            self._asked = self._refined(np.array([*itertools.chain(*found[0])]))
            return
        for point, frames in zip(self._asked, found, strict=True):
            residuals = np.array([*itertools.chain(*frames)])
            self._frames = np.repeat(np.arange(len(frames)), [len(f) for f in frames])
            self._points.append(point)
            self._losses.append(loss(residuals))
            self._known[point.tobytes()] = residuals
        self._asked = self._drawn_through() if self._is_round else self._step()

    def _step(self) -> list[np.ndarray]:
        """Returns the points that the optimizer needs, or the first round's if it converged."""
        drawn = self._points[int(np.argmin(self._losses[:DRAWN]))]
        kept = self._last
        try:
            least_squares(
                self._regularized, drawn if self._first is None else self._first, self._jacobian,
                bounds=self._bounds.T, loss="soft_l1", f_scale=_SCALE, ftol=_TOLERANCE,
                xtol=_STEP_TOLERANCE, gtol=None,
            )  # fmt: skip
        except _Unknown as unknown:
            if len(self._points) + len(unknown.points) <= self._steps:
                if self._rounds:
                    self._last = kept
                return unknown.points
        best = int(np.argmin(self._losses))
        if self._losses[best] < _MET:
            self._estimate, self._spurious = self._points[best], 0.0 * self._spurious
            return []
        if self._rounds:
            self._last = kept
            return self._refine()
        self._estimate = self._points[best]
        return self._round()

    def _drawn_through(self) -> list[np.ndarray]:
        """Moves to the minimum of a surface through the last two rounds; returns new points."""
        points = np.array(self._points[-AROUND * min(self._rounds, 2) :])
        surface = Surface(points, np.array(self._at(list(points))), self._frames)
        self._surface = surface
        self._estimate = x = surface.minimum(self._bounds)
        self._last = surface.residuals(x), surface.jacobian(x)
        self._spurious = surface.spurious(x)
        if self._rounds < ROUNDS:
            return self._round()
        self._first, self._steps, self._is_round = self._inside(x), self._most, False
        return self._step()

    def _refine(self) -> list[np.ndarray]:
        """Asks for an evaluation of the estimate on the finer mesh."""
        self.is_finer = self._refinements > 0
        return [self._inside(self._estimate)] if self.is_finer else []

    def _refined(self, residuals: np.ndarray) -> list[np.ndarray]:
        """Moves to the minimum of the surface shifted to residuals (n,) [m] of the finer mesh."""
        assert self._surface is not None
        self._losses.append(loss(residuals))
        self._refinements -= 1
        self._surface = self._surface.shifted_through(self._asked[0], residuals)
        self._estimate = self._surface.minimum(self._bounds)
        # The Jacobian stays that at the drawn points, where it is known best.
        self._last = self._surface.residuals(self._estimate), self._last[1]
        return self._refine()

    def _round(self) -> list[np.ndarray]:
        self._rounds, self._is_round = self._rounds + 1, True
        return self._drawn(self._estimate, _NEARER, AROUND)

    def _drawn(self, around: np.ndarray, sigma: float, number: int) -> list[np.ndarray]:
        draws = self._random.standard_normal((number, len(around)))
        return [self._inside(around + sigma * draw) for draw in draws]

    def _inside(self, x: np.ndarray) -> np.ndarray:
        return np.clip(x, self._bounds[:, 0] + 1e-6, self._bounds[:, 1] - 1e-6)

    def _at(self, points: list[np.ndarray]) -> list[np.ndarray]:
        """Returns residuals at points, which must be known."""
        if missing := [point for point in points if point.tobytes() not in self._known]:
            raise _Unknown(missing)
        return [self._known[point.tobytes()] for point in points]

    def _regularized(self, x: np.ndarray) -> np.ndarray:
        """Returns residuals at coordinates, and those that pull the coordinates to the start."""
        return np.concatenate([*self._at([np.array(x)]), _REGULARIZATION * (x - self._start)])

    def _jacobian(self, x: np.ndarray) -> np.ndarray:
        """Returns the Jacobian of `_regularized`."""
        steps = np.where(x + _APART <= self._bounds[:, 1], _APART, -_APART)
        forward = self._at([x + step for step in np.diag(steps)])
        (here,) = self._at([np.array(x)])
        jacobian = (np.array(forward) - here).T / steps
        self._last = here, jacobian
        return np.concatenate([jacobian, _REGULARIZATION * np.eye(len(x))])

    def result(self) -> SearchResult:
        """Returns the current state of the search."""
        return SearchResult(
            self._estimate, min(self._losses), len(self._losses), *self._last, self._frames,
            self._spurious,
        )  # fmt: skip


def run_searches(
    searches: Mapping[Any, Search],
    call: Callable[[Any, tuple[float, ...], bool], tuple],
    function: Callable[..., Residuals],
    executor: Executor,
    journals: Mapping[Any, Journal] | None = None,
    progress: Progress = lambda made: None,
) -> None:
    """Runs searches to their ends, a generation of all of them at a time.

    Args:
        searches: by key.
        call: returns the arguments of `function` for a search's key, coordinates, and whether the
            finer mesh is evaluated.
        function: returns residuals of frames.
        executor: makes these calls.
        journals: by the same keys; recorded generations are not evaluated again.
        progress: called after every generation with each search's number of evaluations and least
            loss [m].
    """
    journals = journals or {}
    for key, journal in journals.items():
        for generation in journal.read():
            searches[key].tell(generation)
    while running := {key: search for key, search in searches.items() if not search.is_done}:
        asked = {key: search.ask() for key, search in running.items()}
        calls = [
            call(key, tuple(map(float, x)), running[key].is_finer)
            for key, xs in asked.items()
            for x in xs
        ]
        results = iter(executor.all(function, calls))
        for key, xs in asked.items():
            generation = [next(results) for _ in xs]
            if key in journals:
                journals[key].append(generation)
            running[key].tell(generation)
        progress({key: search.made for key, search in searches.items()})
