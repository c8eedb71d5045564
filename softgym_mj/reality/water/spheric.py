"""Dam break on a box, SPHERIC's second test case: Kleefsman et al. 2005."""

import numpy as np

from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.settings import Setting
from softgym_mj.reality.water.tank import Box, Tank

NAME = "SPHERIC 2"
BOUND = 0.1
LENGTH, WIDTH, COLUMN, DEPTH = 3.22, 1.0, 1.228, 0.55  # [m]
# The water is at X = 0 here, at the far end in the drawing.
BOX = Box((2.3955, 0.2985, 0.0), (2.5565, 0.7015, 0.161))
# [m] X of H1 to H4, in the middle of the width. H1 is next to the reservoir: it is wet first.
GAUGES = (1.732, 2.228, 2.724, 0.582)
DURATION = 6.0  # [s]
_REST = 3.0  # [s]


def simulate(setting: Setting, layers: int) -> tuple[list[Series], int]:
    """Returns the heights [m] at the gauges over time [s], and the number of particles."""
    spacing = DEPTH / layers
    block = (round(COLUMN / spacing), round(WIDTH / spacing), layers)
    tank = Tank(
        LENGTH, block, spacing, setting.liquid,
        width=WIDTH, gate=COLUMN, boxes=[BOX], kernel=setting.kernel,
    )  # fmt: skip
    tank.settle(_REST)
    times, heights = [], []
    while tank.data.time < DURATION:
        tank.step()
        times.append(tank.data.time)
        heights.append([tank.level(x, WIDTH / 2) for x in GAUGES])
    series = [Series(np.array(times), np.array(h)) for h in zip(*heights, strict=True)]
    return series, len(tank.positions)


def error(simulated: Series, recorded: Series) -> float:
    """Returns the root mean square difference over the initial depth."""
    seen = recorded.times <= simulated.times[-1]
    at = np.interp(recorded.times[seen], simulated.times, simulated.values)
    return float(np.sqrt(np.mean((at - recorded.values[seen]) ** 2))) / DEPTH
