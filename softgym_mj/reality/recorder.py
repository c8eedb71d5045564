"""`Recorder`: makes a `Replay` (vertices and failures) from the steps of any engine."""

import dataclasses
import math

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.meshes import Mesh

# Criteria of failures.
MOST_STRAIN = 0.5  # Largest strain of an edge.
DEEPEST = 0.01  # [m] Largest depth of a vertex under the floor.
NOT_FINITE, STRAIN, UNDER_FLOOR = "not finite", "strain", "under the floor"

PERCENTILE = 99.0  # Percentile of the strain of edges.
_ROUNDING = 1e-9  # [s]


@dataclasses.dataclass(frozen=True)
class Failure:
    """Failure of a simulation.

    Attributes:
        kind: "not finite", "strain" (an edge longer than 1.5 times its rest length) or "under the
            floor" (a vertex deeper than 1 cm).
        time: first time [s] at which it occurred.
        value: the strain or the height over the floor [m] at that time.
    """

    kind: str
    time: float
    value: float


@dataclasses.dataclass(frozen=True)
class Steps:
    """Statistics of each step.

    Attributes:
        times: (s,) [s] at the ends of steps.
        strain_99: (s,) 99th percentile of the edges' strain.
        strain_max: (s,) largest strain.
        lowest: (s,) height [m] of the lowest vertex over the floor.
        milliseconds: (s,) CPU time of each step.
    """

    times: np.ndarray
    strain_99: np.ndarray
    strain_max: np.ndarray
    lowest: np.ndarray
    milliseconds: np.ndarray


@dataclasses.dataclass(frozen=True)
class Replay:
    """Simulated motion of a sheet.

    Attributes:
        times: (f,) [s] requested times.
        positions: (f, n, 3) [m] of the vertices at these; NaN after values that are not finite.
        steps: statistics of each step, from the start on.
        failures: the first of each kind, in chronological order.
    """

    times: np.ndarray
    positions: np.ndarray
    steps: Steps
    failures: tuple[Failure, ...]

    @property
    def strain_99(self) -> float:
        """Largest value over all steps of the 99th percentile of the edges' strain."""
        return float(self.steps.strain_99.max())

    @property
    def lowest(self) -> float:
        """Least height [m] of any vertex over the floor."""
        return float(self.steps.lowest.min())

    @property
    def milliseconds(self) -> float:
        """Mean CPU time of a step."""
        return float(self.steps.milliseconds.mean())


class Recorder:
    """Records the steps of a simulation of a mesh, and makes a `Replay`."""

    def __init__(self, mesh: Mesh, times: np.ndarray, floor: float | None = 0.0):
        """Starts a recording of a mesh at requested times.

        Args:
            mesh: mesh at rest.
            times: (f,) [s] in order.
            floor: height of the floor [m]; None for none.

        Raises:
            InvalidArgumentError: for times that are not finite or not in order.
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
        """Records vertices (n, 3) [m] before the first step, at a time [s]."""
        if len(self._times) and when > self._times[0] + _ROUNDING:
            raise InvalidArgumentError("times", self._times[0], f"{when} s or later")
        self._pass(when, positions)

    def add(self, when: float, positions: np.ndarray, milliseconds: float) -> bool:
        """Records a step: vertices (n, 3) [m] at its end [s], and its CPU time.

        Returns:
            Whether all values are finite, so that the simulation can continue.
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
        """Records vertices at the end of a step without its statistics."""
        if not np.isfinite(positions).all():
            self._fail(NOT_FINITE, when, math.nan)
            return False
        self._pass(when, positions)
        return True

    def fail(self, when: float) -> None:
        """Records that an engine failed at a time [s], as if values were not finite."""
        self._fail(NOT_FINITE, when, math.nan)

    def replay(self) -> Replay:
        """Returns the recorded motion."""
        columns = np.array(self._steps, float).reshape(-1, 5).T
        return Replay(self._times, self._positions, Steps(*columns), tuple(self._failures.values()))

    def _fail(self, kind: str, when: float, value: float) -> None:
        self._failures.setdefault(kind, Failure(kind, when, value))

    def _pass(self, when: float, positions: np.ndarray) -> None:
        """Interpolates vertices linearly at the requested times up to this one."""
        while self._next < len(self._times) and self._times[self._next] <= when + _ROUNDING:
            earlier, before = (when, positions) if self._before is None else self._before
            way = when - earlier
            share = 1.0 if way <= 0.0 else min((self._times[self._next] - earlier) / way, 1.0)
            self._positions[self._next] = (1.0 - share) * before + share * positions
            self._next += 1
        self._before = when, np.array(positions)
