"""Searches by least squares, several side by side, whose evaluations any executor makes.

A search draws places around its start, and goes on from the best by trust-region steps. Where these
find no offsets near zero it draws around where they ended, and goes to the least of a surface
through what it draws; then again around there, and tries steps once more. In the end, what a finer
mesh makes of the same coordinates says by how much that surface is off.

The optimizer of SciPy calls what it minimises; here it is asked what it wants to know, so that
other processes may find out: it is run anew from the start, on all that is known, until it asks
for more.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from softgym_mj.exceptions import check_count
from softgym_mj.jobs.executors import Executor
from softgym_mj.jobs.journal import Journal
from softgym_mj.reality.identification.surface import Surface

Progress = Callable[[dict[Any, tuple[int, float]]], None]
Offsets = Sequence[Sequence[float]]  # [m] Of each frame.

DRAWN = 12  # Places, the start among them.
AROUND, ROUNDS = 36, 3  # Places that are drawn around where steps ended, and how often.
EVALUATIONS = 240
_AGAIN = 30  # Evaluations of steps from where rounds ended: with data of the same mesh they arrive.
_SIGMA, _NEARER = 0.6, 0.3  # Of coordinates that are drawn, at first and then.
_APART = 0.1  # Of coordinates between which slopes are taken.
# [m] For each coordinate by which one is off the start, as one more offset of thousands: what no
# frame shows stays there.
_PULL = 2e-5
_SCALE = 1.5e-3  # [m] From which on offsets count by themselves, not by their squares.
# Of the loss's square. Steps that make it smaller by less follow its roughness: where a search's
# mesh is another than that of the data, on to five times the bending stiffness.
_TOLERANCE = 0.1
_STEP_TOLERANCE = 1e-4  # Of a step, to the length of all coordinates, which is about 15.
_MET = 3e-4  # [m] Loss below which nothing is left that more evaluations would tell.


@dataclasses.dataclass(frozen=True)
class Found:
    """Where a search has come to.

    Attributes:
        estimate: (unknowns,) coordinates.
        loss: the least of all evaluations [m].
        evaluations: how many it has made.
        offsets: (n,) there, or nearby, each by its noise if that is known.
        slopes: (n, unknowns) of these.
        frames: (n,) the frame that each belongs to.
        spurious: (unknowns, unknowns) what is in the products of slopes by chance.
    """

    estimate: np.ndarray
    loss: float
    evaluations: int
    offsets: np.ndarray
    slopes: np.ndarray
    frames: np.ndarray
    spurious: np.ndarray


def loss(offsets: np.ndarray) -> float:
    """Root of the mean square of offsets [m], of which large ones count by themselves."""
    squares = (offsets / _SCALE) ** 2
    return float(_SCALE * np.sqrt(np.mean(2.0 * (np.sqrt(1.0 + squares) - 1.0))))


class _Unknown(Exception):
    """Evaluations that have not been made, at `points`."""

    def __init__(self, points: list[np.ndarray]):
        super().__init__(points)
        self.points = points


class Search:
    """One search: asks for evaluations and is told of them, a generation at a time.

    Attributes:
        is_finer: whether what it asks for is of the finer mesh.
    """

    def __init__(
        self,
        start: np.ndarray,
        bounds: np.ndarray,
        seed: int,
        evaluations: int = EVALUATIONS,
        looks: int = 0,
    ):
        """Starts at coordinates (unknowns,) within bounds (unknowns, 2).

        Args:
            start, bounds: coordinates.
            seed: of what it draws.
            evaluations: how many it may ask for.
            looks: how many of a finer mesh it asks for besides, unless offsets are met.

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
        self._looks, self.is_finer = looks, False
        self._surface: Surface | None = None
        self._first: np.ndarray | None = None  # Where steps go on from; None for the best drawn.
        self._estimate, self._last = self._start, (np.zeros(0), np.zeros((0, len(start))))
        self._spurious = np.zeros((len(start), len(start)))
        self._asked = [self._start, *self._drawn(self._start, _SIGMA, DRAWN - 1)]

    @property
    def is_done(self) -> bool:
        """Whether it asks for nothing more."""
        return not self._asked

    @property
    def made(self) -> tuple[int, float]:
        """How many evaluations it has been told of, and their least loss [m]."""
        return len(self._losses), min(self._losses, default=math.inf)

    def ask(self) -> list[np.ndarray]:
        """Coordinates (unknowns,) of the next generation; the same until it is told of them."""
        return self._asked

    def tell(self, found: Sequence[Offsets]) -> None:
        """Takes the offsets [m] of all frames at each of what was asked for."""
        if self.is_finer:
            self._asked = self._looked(np.array([*itertools.chain(*found[0])]))
            return
        for point, frames in zip(self._asked, found, strict=True):
            offsets = np.array([*itertools.chain(*frames)])
            self._frames = np.repeat(np.arange(len(frames)), [len(f) for f in frames])
            self._points.append(point)
            self._losses.append(loss(offsets))
            self._known[point.tobytes()] = offsets
        self._asked = self._drawn_through() if self._is_round else self._step()

    def _step(self) -> list[np.ndarray]:
        """What the optimizer wants to know; when it has come to an end, the first round."""
        drawn = self._points[int(np.argmin(self._losses[:DRAWN]))]
        kept = self._last
        try:
            least_squares(
                self._pulled, drawn if self._first is None else self._first, self._slopes,
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
            return self._look()
        self._estimate = self._points[best]
        return self._round()

    def _drawn_through(self) -> list[np.ndarray]:
        """Goes to the least of a surface through the last two rounds; then the next, or steps."""
        points = np.array(self._points[-AROUND * min(self._rounds, 2) :])
        surface = Surface(points, np.array(self._at(list(points))), self._frames)
        self._surface = surface
        self._estimate = x = surface.least(self._bounds)
        self._last = surface.offsets(x), surface.slopes(x)
        self._spurious = surface.spurious(x)
        if self._rounds < ROUNDS:
            return self._round()
        self._first, self._steps, self._is_round = self._inside(x), self._most, False
        return self._step()

    def _look(self) -> list[np.ndarray]:
        """Asks for what a finer mesh makes of the estimate."""
        self.is_finer = self._looks > 0
        return [self._inside(self._estimate)] if self.is_finer else []

    def _looked(self, offsets: np.ndarray) -> list[np.ndarray]:
        """Goes to the least of the surface that is moved to the finer mesh's offsets (n,) [m]."""
        assert self._surface is not None
        self._losses.append(loss(offsets))
        self._looks -= 1
        self._surface = self._surface.through(self._asked[0], offsets)
        self._estimate = self._surface.least(self._bounds)
        # Slopes stay those of where places were drawn: there they are known best.
        self._last = self._surface.offsets(self._estimate), self._last[1]
        return self._look()

    def _round(self) -> list[np.ndarray]:
        self._rounds, self._is_round = self._rounds + 1, True
        return self._drawn(self._estimate, _NEARER, AROUND)

    def _drawn(self, around: np.ndarray, sigma: float, number: int) -> list[np.ndarray]:
        draws = self._random.standard_normal((number, len(around)))
        return [self._inside(around + sigma * draw) for draw in draws]

    def _inside(self, x: np.ndarray) -> np.ndarray:
        return np.clip(x, self._bounds[:, 0] + 1e-6, self._bounds[:, 1] - 1e-6)

    def _at(self, points: list[np.ndarray]) -> list[np.ndarray]:
        """Offsets at points, which are known."""
        if missing := [point for point in points if point.tobytes() not in self._known]:
            raise _Unknown(missing)
        return [self._known[point.tobytes()] for point in points]

    def _pulled(self, x: np.ndarray) -> np.ndarray:
        """Offsets at coordinates, and what pulls these to the start."""
        return np.concatenate([*self._at([np.array(x)]), _PULL * (x - self._start)])

    def _slopes(self, x: np.ndarray) -> np.ndarray:
        """The Jacobian of this."""
        steps = np.where(x + _APART <= self._bounds[:, 1], _APART, -_APART)
        beside = self._at([x + step for step in np.diag(steps)])
        (here,) = self._at([np.array(x)])
        slopes = (np.array(beside) - here).T / steps
        self._last = here, slopes
        return np.concatenate([slopes, _PULL * np.eye(len(x))])

    def found(self) -> Found:
        """Where it has come to."""
        return Found(
            self._estimate, min(self._losses), len(self._losses), *self._last, self._frames,
            self._spurious,
        )  # fmt: skip


def together(
    searches: Mapping[Any, Search],
    call: Callable[[Any, tuple[float, ...], bool], tuple],
    function: Callable[..., Offsets],
    executor: Executor,
    journals: Mapping[Any, Journal] | None = None,
    progress: Progress = lambda made: None,
) -> None:
    """Advances searches to their ends, a generation of all of them at a time.

    Args:
        searches: by key.
        call: the arguments of `function` for a search's key, coordinates, and whether it asks for
            the finer mesh.
        function: gives offsets of frames.
        executor: that makes these calls.
        journals: of the same keys; generations that they have are not made again.
        progress: told, after every generation, of each search how many evaluations it has made and
            their least loss [m].
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
