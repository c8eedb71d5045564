"""`Recorder` makes a `Replay` of the steps of any engine: where vertices were, and what failed."""

import dataclasses
import math

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.meshes import Mesh

# What counts as a failure.
MOST_STRAIN = 0.5  # Of any edge.
DEEPEST = 0.01  # [m] Of a vertex under the floor.
NOT_FINITE, STRAIN, UNDER_FLOOR = "not finite", "strain", "under the floor"

PERCENTILE = 99.0  # Of the strain of edges.
_ROUNDING = 1e-9  # [s]


@dataclasses.dataclass(frozen=True)
class Failure:
    """What went wrong.

    Attributes:
        kind: "not finite", "strain" (an edge longer than 1.5 times its length at rest) or "under
            the floor" (a vertex deeper than 1 cm).
        time: when it did first [s].
        value: the strain or the height over the floor [m] then.
    """

    kind: str
    time: float
    value: float


@dataclasses.dataclass(frozen=True)
class Steps:
    """How it was after each step.

    Attributes:
        times: (s,) [s] at their ends.
        strain_99: (s,) 99th percentile of the edges' elongation.
        strain_max: (s,) the largest.
        lowest: (s,) height [m] of the lowest vertex over the floor.
        milliseconds: (s,) of the CPU that each took.
    """

    times: np.ndarray
    strain_99: np.ndarray
    strain_max: np.ndarray
    lowest: np.ndarray
    milliseconds: np.ndarray


@dataclasses.dataclass(frozen=True)
class Replay:
    """What a sheet did.

    Attributes:
        times: (f,) [s] that were asked for.
        positions: (f, n, 3) [m] of the vertices at these; not a number after numbers were not
            finite.
        steps: how it was after each step, from the beginning on.
        failures: the first of each kind, in the order in which they came.
    """

    times: np.ndarray
    positions: np.ndarray
    steps: Steps
    failures: tuple[Failure, ...]

    @property
    def strain_99(self) -> float:
        """Largest over all steps of the 99th percentile of the edges' elongation."""
        return float(self.steps.strain_99.max())

    @property
    def lowest(self) -> float:
        """Least height [m] of any vertex over the floor."""
        return float(self.steps.lowest.min())

    @property
    def milliseconds(self) -> float:
        """CPU time of a step, on average."""
        return float(self.steps.milliseconds.mean())


class Recorder:
    """Takes down the steps of a simulation of a mesh, and makes a `Replay` of them."""

    def __init__(self, mesh: Mesh, times: np.ndarray, floor: float | None = 0.0):
        """Of a mesh that is asked for at some times.

        Args:
            mesh: at rest.
            times: (f,) [s] in order.
            floor: its height [m]; None for none.

        Raises:
            InvalidArgumentError: for times that are not finite or in no order.
        """
        self._mesh, self._floor = mesh, floor
        self._times = np.asarray(times, float)
        if self._times.ndim != 1 or not np.isfinite(self._times).all():
            raise InvalidArgumentError("times", self._times.shape, "finite, of a shape (f,)")
        if (np.diff(self._times) < 0.0).any():
            raise InvalidArgumentError("times", times, "in order")
        self._positions = np.full((len(self._times), *mesh.points.shape), np.nan)
        self._steps: list[tuple[float, float, float, float, float]] = []
        self._failures: dict[str, Failure] = {}
        self._before: tuple[float, np.ndarray] | None = None
        self._next = 0

    def start(self, when: float, positions: np.ndarray) -> None:
        """Takes down where vertices (n, 3) [m] are before the first step, at a time [s]."""
        if len(self._times) and when > self._times[0] + _ROUNDING:
            raise InvalidArgumentError("times", self._times[0], f"{when} s or later")
        self._pass(when, positions)

    def add(self, when: float, positions: np.ndarray, milliseconds: float) -> bool:
        """Takes down a step: where vertices (n, 3) [m] are at its end [s], what it took.

        Returns:
            Whether all numbers are finite, so that it makes sense to go on.
        """
        if not np.isfinite(positions).all():
            self._fail(NOT_FINITE, when, math.nan)
            return False
        strain = self._mesh.strain(positions)
        largest = float(strain.max())
        lowest = math.inf if self._floor is None else float(positions[:, 2].min() - self._floor)
        percentile = float(np.percentile(strain, PERCENTILE))
        self._steps.append((when, percentile, largest, lowest, milliseconds))
        if largest > MOST_STRAIN:
            self._fail(STRAIN, when, largest)
        if lowest < -DEEPEST:
            self._fail(UNDER_FLOOR, when, lowest)
        self._pass(when, positions)
        return True

    def see(self, when: float, positions: np.ndarray) -> bool:
        """As `add`, of a step whose strain and heights are of no interest: it is not taken down."""
        if not np.isfinite(positions).all():
            self._fail(NOT_FINITE, when, math.nan)
            return False
        self._pass(when, positions)
        return True

    def fail(self, when: float) -> None:
        """Takes down that an engine gave up at a time [s], as if its numbers were not finite."""
        self._fail(NOT_FINITE, when, math.nan)

    def replay(self) -> Replay:
        """What was taken down."""
        columns = np.array(self._steps, float).reshape(-1, 5).T
        return Replay(self._times, self._positions, Steps(*columns), tuple(self._failures.values()))

    def _fail(self, kind: str, when: float, value: float) -> None:
        self._failures.setdefault(kind, Failure(kind, when, value))

    def _pass(self, when: float, positions: np.ndarray) -> None:
        """Notes where vertices were at the times up to this one, straight between steps."""
        while self._next < len(self._times) and self._times[self._next] <= when + _ROUNDING:
            earlier, before = (when, positions) if self._before is None else self._before
            way = when - earlier
            share = 1.0 if way <= 0.0 else min((self._times[self._next] - earlier) / way, 1.0)
            self._positions[self._next] = (1.0 - share) * before + share * positions
            self._next += 1
        self._before = when, np.array(positions)
