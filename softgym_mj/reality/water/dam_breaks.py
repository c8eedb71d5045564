"""Experiments in which a gate releases water."""

import dataclasses
import math
import pathlib

import numpy as np

from softgym_mj.cloth.fabrics import GRAVITY
from softgym_mj.fluid import Liquid
from softgym_mj.reality.water import recordings
from softgym_mj.reality.water.experiments import LANES, Error, Run
from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.signals import errors
from softgym_mj.reality.water.tank import Box, Tank, depth, front

FRONT = 0.05  # Bound of errors of fronts, relative to them.
DELAYS = np.arange(0.0, 1.0, 0.01)  # Delays of a release that are tried, in recorded units.
HEIGHT = 0.1  # Bound of errors of heights, relative to the depth.


@dataclasses.dataclass(frozen=True)
class DamBreak:
    """A column of water, twice as high as long, that a gate releases in a channel.

    Attributes:
        table: Name of the recorded front: z/a over t sqrt(2 g / a).
        column: Length a of the column [m].
        channel: Length of the channel in columns.
        lifted: Whether the gate is lifted as slowly as still counts as sudden, out of the water
            after sqrt(2 depth / g) (Lauber and Hager, J. Hydraulic Research 36, 1998). Otherwise it
            vanishes at once.
        computed: Name of a front in the same file that another method computed, by its title.
    """

    table: str
    column: float
    channel: float
    lifted: bool = False
    computed: tuple[tuple[str, str], ...] = ()

    @property
    def depth(self) -> float:
        """Height of the column [m]."""
        return 2.0 * self.column

    @property
    def unit(self) -> float:
        """Unit of recorded times [s]."""
        return math.sqrt(self.column / (2.0 * GRAVITY))

    def read(self, folder: pathlib.Path | None) -> Series:
        """Returns the recorded front z/a over t sqrt(2 g / a)."""
        return recordings.read_table(folder, recordings.DAM_BREAKS, self.table)

    def others(self, folder: pathlib.Path | None, until: float) -> dict[str, Run]:
        """Returns fronts that other methods computed."""
        found = {}
        for title, name in self.computed:
            table = recordings.read_table(folder, recordings.DAM_BREAKS, name)
            found[title] = Run(table.times, table.values)
        return found

    def simulate(self, liquid: Liquid, spacing: float, until: float) -> Run:
        """Simulates the front since the gate began to move, or vanished."""
        a, width = self.column, LANES * spacing
        column = Box((0.0, -width / 2.0, 0.0), (a, width / 2.0, self.depth))
        size = self.channel * a, width, 2.0 * self.depth
        tank = Tank(size, column, spacing, liquid, gate=True)
        if not self.lifted:
            tank.remove_gate()
        lift = math.sqrt(GRAVITY * self.depth / 2.0)  # [m/s]
        fronts = [front(tank.points, tank.spacing, width)]
        for step in range(math.ceil(until * self.unit / tank.timestep)):
            if self.lifted:
                tank.lift_gate(lift * (step + 1) * tank.timestep)
            tank.step()
            fronts.append(front(tank.points, tank.spacing, width))
        times = tank.timestep / self.unit * np.arange(len(fronts))
        return Run(times, np.array(fronts) / a, len(tank.points))

    def compare(self, recording: Series, run: Run) -> list[Error]:
        """Returns errors of the front, relative to each recorded one.

        The first compares at recorded times. Recordings do not define when their clock starts, so
        the second compares each position after the delay of the release with which the others fit
        best; its name has their mean.
        """
        delayed = recording.times - DELAYS[:, None]  # (delays, n)
        fronts = np.interp(delayed, run.times, run.values) / recording.values
        squares = (fronts - 1.0) ** 2
        best = (squares.sum(axis=1, keepdims=True) - squares).argmin(axis=0)
        held_out = fronts[best, np.arange(len(best))]
        late = f"front released {1e3 * DELAYS[best].mean() * self.unit:.0f} ms later"
        same = np.ones_like(recording.times)
        return [
            Error("front", *errors(fronts[0], same), FRONT),
            Error(late, *errors(held_out, same), FRONT),
        ]


@dataclasses.dataclass(frozen=True)
class Obstacle:
    """SPHERIC's test case 2: a dam break onto a box (Kleefsman et al., 2005)."""

    depth: float = 0.55  # [m]
    size: tuple[float, float, float] = (3.22, 1.0, 2.0)  # [m] Higher than splashes; it was 1 m.
    column: float = 1.228  # [m] Its length along X, from x = 0 on.
    # [m] Center of the box along X, and its size.
    box: tuple[float, float, float, float] = (2.476, 0.161, 0.403, 0.161)
    # [m] Gauges H1 to H4 along X, H1 nearest to the gate as its arrival shows.
    gauges: tuple[float, ...] = (1.732, 2.228, 2.724, 0.582)

    @property
    def unit(self) -> float:
        """Unit of recorded times [s]."""
        return 1.0

    def read(self, folder: pathlib.Path | None) -> Series:
        """Returns recorded heights (n, 4) [m] over times [s]."""
        return recordings.read_spheric(folder)

    def others(self, folder: pathlib.Path | None, until: float) -> dict[str, Run]:
        """Returns the baseline that the water's volume is spread evenly over the floor."""
        length, width, _ = self.size
        _, box_length, across, _ = self.box
        floor = length * width - box_length * across
        level = self.column * width * self.depth / floor
        return {"level water": Run(np.array([0.0, until]), np.full((2, len(self.gauges)), level))}

    def simulate(self, liquid: Liquid, spacing: float, until: float) -> Run:
        """Simulates heights (n, 4) [m] at the gauges from the gate's removal on."""
        width = self.size[1]
        column = Box((0.0, -width / 2.0, 0.0), (self.column, width / 2.0, self.depth))
        x, length, across, high = self.box
        low, up = (x - length / 2.0, -across / 2.0, 0.0), (x + length / 2.0, across / 2.0, high)
        tank = Tank(self.size, column, spacing, liquid, (Box(low, up),), gate=True)
        tank.remove_gate()
        heights = []
        for _ in range(math.ceil(until / tank.timestep) + 1):
            points = tank.points
            heights.append([depth(points, tank.spacing, x) for x in self.gauges])
            tank.step()
        times = tank.timestep * np.arange(len(heights))
        return Run(times, np.array(heights), len(tank.points))

    def compare(self, recording: Series, run: Run) -> list[Error]:
        """Returns errors of the gauges, relative to the depth."""
        found = []
        for gauge, recorded in enumerate(recording.values.T):
            there = np.interp(recording.times, run.times, run.values[:, gauge])
            both = errors(there / self.depth, recorded / self.depth)
            found.append(Error(f"H{gauge + 1}", *both, HEIGHT))
        return found
