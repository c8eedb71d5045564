"""Fronts of collapsing columns: Martin and Moyce 1952, Koshizuka and Oka 1996."""

import dataclasses
import math

import numpy as np

from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.settings import Setting
from softgym_mj.reality.water.tank import GRAVITY, Tank

BOUND = 0.05
_ROWS = 8  # Particles across the channel.
_LONGEST = 15.0  # Length of the channel in widths of the column.
_REST = 12.0  # Time to come to rest, in units of `time_unit`.
_DELAYS = np.arange(-0.6, 0.8, 0.01)  # Trial delays of the release, in units of `time_unit`.


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of water that collapses: twice as high as wide.

    Attributes:
        name: Name of the experiment.
        table: Name of its table in `DAM_BREAKS`: front over width, over time in units of
            `time_unit`.
        width: Width of the column [m].
    """

    name: str
    table: str
    width: float

    @property
    def time_unit(self) -> float:
        """Unit of time [s] of the recordings."""
        return math.sqrt(self.width / (2 * GRAVITY))


COLUMNS = (
    Column("Martin and Moyce, 1.125 in", "mm_data_1", 0.028575),
    Column("Martin and Moyce, 2.25 in", "mm_data_2", 0.05715),
    Column("Koshizuka and Oka", "ko_data", 0.146),
    Column("Koshizuka and Oka, their simulation", "ko_mps_data", 0.146),
)


def simulate(column: Column, setting: Setting, layers: int, end: float) -> tuple[Series, int]:
    """Returns the front over the width, over time in units of `time_unit`, and the particle count.

    The front is the median over rows across the channel, half a spacing beyond the foremost
    particle. The gate is removed at once. The simulation ends at `end`, in units of time.
    """
    across = layers // 2
    spacing = column.width / across
    length, block = _LONGEST * column.width, (across, _ROWS, layers)
    tank = Tank(length, block, spacing, setting.liquid, gate=column.width, kernel=setting.kernel)
    tank.settle(_REST * column.time_unit)
    times, fronts = [0.0], [front(tank.positions, spacing)]
    while times[-1] < end:
        tank.step()
        times.append(tank.data.time / column.time_unit)
        fronts.append(front(tank.positions, spacing))
    return Series(np.array(times), np.array(fronts) / column.width), len(tank.positions)


def front(positions: np.ndarray, spacing: float) -> float:
    """Returns the position [m] of the front of particles (n, 3) in a channel of `_ROWS` rows."""
    rows = np.clip((positions[:, 1] / spacing).astype(int), 0, _ROWS - 1)
    furthest = np.full(_ROWS, -np.inf)
    np.maximum.at(furthest, rows, positions[:, 0])
    return float(np.median(furthest[np.isfinite(furthest)])) + spacing / 2


def error(simulated: Series, recorded: Series, delay: float = 0.0) -> float:
    """Returns the root mean square of relative differences, with a release delayed by `delay`."""
    at = np.interp(recorded.times - delay, simulated.times, simulated.values)
    return float(np.sqrt(np.mean((at / recorded.values - 1) ** 2)))


def best_delay(simulated: Series, recorded: Series) -> float:
    """Returns the delay of the release with the smallest error, in units of time."""
    return float(min(_DELAYS, key=lambda delay: error(simulated, recorded, delay)))
