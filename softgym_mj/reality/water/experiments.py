"""`Experiment`: a recorded experiment with water that is simulated."""

import dataclasses
import pathlib
from typing import Protocol

import numpy as np

from softgym_mj.fluid import Liquid
from softgym_mj.reality.water.recordings import Series

LANES = 8  # Width of two-dimensional experiments, in spacings.


@dataclasses.dataclass(frozen=True)
class Run:
    """Signal of a solution, in the units of its recording.

    Attributes:
        times: (n,)
        values: (n,) or (n, gauges).
        particles: Number of particles; 0 if there are none.
    """

    times: np.ndarray
    values: np.ndarray
    particles: int = 0


@dataclasses.dataclass(frozen=True)
class Error:
    """Difference between a solution and a recording.

    Attributes:
        quantity: What is compared, such as "front", "H1", "period", "amplitude" or "elevation".
        value: Root mean square error, relative to recorded fronts, the depth, or the recorded
            standard deviation of elevations; or the signed error of a period or an amplitude.
        mean: Mean error, signed.
        bound: Largest magnitude of `value` that passes; None passes any.
    """

    quantity: str
    value: float
    mean: float
    bound: float | None

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound."""
        return self.bound is None or abs(self.value) <= self.bound


class Experiment(Protocol):
    """An experiment."""

    @property
    def depth(self) -> float:
        """Depth of the water at rest [m]."""

    @property
    def unit(self) -> float:
        """Unit of recorded times [s]."""

    def read(self, folder: pathlib.Path | None) -> Series:
        """Returns its recording; raises the errors of `recordings`."""

    def others(self, folder: pathlib.Path | None, until: float) -> dict[str, Run]:
        """Returns solutions by others, up to a time, by name."""

    def simulate(self, liquid: Liquid, spacing: float, until: float) -> Run:
        """Simulates water of particles with a spacing [m] up to a time in the recording's unit."""

    def compare(self, recording: Series, run: Run) -> list[Error]:
        """Compares a solution with the recording."""
