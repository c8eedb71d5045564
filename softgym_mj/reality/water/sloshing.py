"""Sloshing in a tank that is moved."""

import dataclasses
import math
import pathlib

import numpy as np

from softgym_mj.cloth.fabrics import GRAVITY
from softgym_mj.fluid import Liquid
from softgym_mj.reality.water import recordings
from softgym_mj.reality.water.experiments import LANES, Error, Run
from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.signals import STRETCH, errors, likeness
from softgym_mj.reality.water.tank import Box, Tank, depth

PERIOD, AMPLITUDE = 0.02, 0.15  # Bounds of their relative errors.


@dataclasses.dataclass(frozen=True)
class Sloshing:
    """A tank that is moved along X like a cosine or a sine, with a gauge near its end.

    Attributes:
        table: Name of the recorded elevation [m] at the gauge.
        length: Length of the tank [m].
        depth: Depth of the water [m].
        amplitude, period: Amplitude [m] and period [s] of the tank.
        starts_at_rest: Whether the motion begins at a turning point; otherwise at full speed.
        unit: Unit of recorded times [s].
        gauge: Distance of the gauge from the end [m].
    """

    table: str
    length: float
    depth: float
    amplitude: float
    period: float
    starts_at_rest: bool
    unit: float = 1.0
    gauge: float = 0.05

    def position(self, time: float) -> float:
        """Returns the tank's position along X [m]."""
        phase = 2.0 * math.pi * time / self.period
        return self.amplitude * (math.cos(phase) - 1.0 if self.starts_at_rest else math.sin(phase))

    def read(self, folder: pathlib.Path | None) -> Series:
        """Returns the recorded elevation [m]."""
        return recordings.read_table(folder, recordings.SLOSHING, self.table)

    def others(self, folder: pathlib.Path | None, until: float) -> dict[str, Run]:
        """Returns linear waves."""
        times = np.linspace(0.0, STRETCH * until, 4001)
        return {"linear waves": Run(times, self.linear(times * self.unit))}

    def simulate(self, liquid: Liquid, spacing: float, until: float) -> Run:
        """Simulates elevations [m] at the gauge, up to `STRETCH` times `until`."""
        width = LANES * spacing
        water = Box((0.0, -width / 2.0, 0.0), (self.length, width / 2.0, self.depth))
        tank = Tank((self.length, width, 4.0 * self.depth), water, spacing, liquid)
        heights = []
        for step in range(math.ceil(STRETCH * until * self.unit / tank.timestep) + 1):
            heights.append(depth(tank.points, tank.spacing, self.gauge, width))
            tank.move(self.position((step + 1) * tank.timestep))
            tank.step()
        times = tank.timestep / self.unit * np.arange(len(heights))
        return Run(times, np.array(heights) - heights[0], len(tank.points))

    def compare(self, recording: Series, run: Run) -> list[Error]:
        """Returns errors of period and amplitude, and what differs without a stretch."""
        there = np.interp(recording.times, run.times, run.values)
        rest = errors(there / recording.values.std(), recording.values / recording.values.std())
        found = likeness(run.times, run.values, recording.times, recording.values)
        off = found.period - 1.0, found.amplitude - 1.0
        return [
            Error("period", off[0], off[0], PERIOD),
            Error("amplitude", off[1], off[1], AMPLITUDE),
            Error("elevation", *rest, None),
        ]

    def linear(self, times: np.ndarray, modes: int = 9) -> np.ndarray:
        """Returns elevations (n,) [m] at the gauge by linear waves without damping.

        Modes cos(k x) of the potential flow, k = n pi / length for odd n, have frequencies of
        w^2 = g k tanh(k depth) and are driven by the tank's acceleration. Water starts at rest.
        """
        drive, at = 2.0 * math.pi / self.period, times
        elevation = np.zeros_like(times)
        for n in range(1, 2 * modes, 2):
            k = n * math.pi / self.length
            response, own = math.tanh(k * self.depth), _frequency(k, self.depth)
            if self.starts_at_rest:
                swing = drive * (np.cos(drive * at) - np.cos(own * at))
            else:
                swing = drive * np.sin(drive * at) - own * np.sin(own * at)
            force = -4.0 / (n * math.pi) * response * self.amplitude * drive
            elevation += force / (own**2 - drive**2) * math.cos(k * self.gauge) * swing
        return elevation


def natural_period(length: float, depth: float) -> float:
    """Returns the period [s] of the first sloshing mode of a tank by linear waves."""
    return 2.0 * math.pi / _frequency(math.pi / length, depth)


def _frequency(k: float, depth: float) -> float:
    """Returns the angular frequency [rad/s] of linear waves of wave number k [rad/m]."""
    return math.sqrt(GRAVITY * k * math.tanh(k * depth))
