"""Sloshing in tanks that move along their length: Faltinsen et al. 2000, Bouscasse et al. 2013."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.settings import Setting
from softgym_mj.reality.water.tank import GRAVITY, Tank

PERIOD_BOUND, AMPLITUDE_BOUND = 0.02, 0.15
_ROWS = 8  # Particles across the tank.
_REST = 3.0  # [s]
_STRETCHES = np.linspace(0.95, 1.05, 1001)  # Trial ratios of periods.


@dataclasses.dataclass(frozen=True)
class Motion:
    """A tank, its motion, and a gauge.

    Attributes:
        name: Name of the experiment.
        table: Name of its table in `SLOSHING`: elevation [m] over time in units of `time_unit`.
        length, depth: Size of the water at rest [m].
        gauge: Position of the gauge [m].
        time_unit: Unit of time of the recording [s].
        offset: Position of the tank [m] over time [s].
    """

    name: str
    table: str
    length: float
    depth: float
    gauge: float
    time_unit: float
    offset: Callable[[float], float]


def natural_frequency(length: float, depth: float) -> float:
    """Returns the angular frequency [1/s] of the first mode of small waves."""
    k = math.pi / length
    return math.sqrt(GRAVITY * k * math.tanh(k * depth))


def _faltinsen(t: float) -> float:
    return 0.032 * (1 - math.cos(2 * math.pi / 1.3 * t))


_BOUSCASSE = 1.231 * natural_frequency(1.0, 0.03)  # [1/s]


def _bouscasse(t: float) -> float:
    return 0.07 * math.sin(_BOUSCASSE * t)


MOTIONS = (
    # The recorded level falls first, so the gauge is at the wall that the tank moves towards.
    Motion("Faltinsen et al.", "faltinsen", 1.73, 0.6, 1.68, 1.0, _faltinsen),
    Motion(
        "Bouscasse et al.", "bouscasse_5", 1.0, 0.03, 0.05, 2 * math.pi / _BOUSCASSE, _bouscasse
    ),
)


def simulate(motion: Motion, setting: Setting, layers: int, end: float) -> tuple[Series, int]:
    """Returns the elevation [m] over time in units of the recording, and the number of particles.

    Args:
        motion: The experiment.
        setting: Liquid and kernel.
        layers: Particles over the depth.
        end: End of the recording, in its unit.
    """
    spacing = motion.depth / layers
    block = (round(motion.length / spacing), _ROWS, layers)
    tank = Tank(motion.length, block, spacing, setting.liquid, kernel=setting.kernel)
    tank.settle(_REST)
    # The level of particles at rest near a wall varies by a third of a spacing.
    start = len(tank.positions) * spacing**3 / (tank.length * tank.width)
    times, elevations = [0.0], [0.0]
    while times[-1] < end:
        tank.step(motion.offset(tank.data.time + tank.timestep))
        times.append(tank.data.time / motion.time_unit)
        elevations.append(tank.level(motion.gauge) - start)
    return Series(np.array(times), np.array(elevations)), len(tank.positions)


def compare(simulated: Series, recorded: Series) -> tuple[float, float, float]:
    """Returns the errors of period and amplitude, and the rest that these two do not explain.

    The period is that of the simulation stretched in time until it fits best; the amplitude is the
    standard deviation; the rest is relative to the recording's.
    """
    values = recorded.values - recorded.values.mean()

    def stretched(ratio: float) -> np.ndarray:
        at = np.interp(ratio * recorded.times, simulated.times, simulated.values)
        return at - at.mean()

    ratio = min(_STRETCHES, key=lambda ratio: np.sum((stretched(ratio) - values) ** 2))
    best, size = stretched(ratio), values.std()
    amplitude = best.std() / size
    rest = (best / max(amplitude, 1e-9) - values).std() / size
    return float(ratio - 1), float(amplitude - 1), float(rest)
