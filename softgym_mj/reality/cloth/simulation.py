"""`ClothSolver`: predicts recordings of a cloth with this package's cloth."""

import dataclasses
import math

import mujoco
import numpy as np

from softgym_mj.cloth.solver import TIMESTEP
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import SimulationError, check_number
from softgym_mj.reality.cloth.scenario import Grip, Scenario
from softgym_mj.reality.cloth.sheet import compiled, rectangle
from softgym_mj.reality.solver import step

SETTLING = 1.0  # [s] Time for which the cloth hangs before the tool's first pose.


@dataclasses.dataclass(frozen=True)
class Properties:
    """Properties of a cloth.

    Attributes:
        density: Mass per area [kg/m^2].
        bend: Moment per width and curvature [N m].
        bend_damping: Dashpot as a multiple of it [s].
        drag: Coefficient of air drag for motion along the normal.
        added_mass: Mass of air moved along with the surface [kg/m^2].
        length: Length down from the held edge, relative to the measured one.
    """

    density: float
    bend: float
    bend_damping: float
    drag: float
    added_mass: float
    length: float = 1.0

    def __post_init__(self):
        for field in dataclasses.fields(self):
            check_number(field.name, getattr(self, field.name), gt=0.0, lt=math.inf)


# A light cloth, in air as a plate of its width: drag across the flow, pi/4 w 1.2 kg/m^3.
ASSUMED = Properties(density=0.2, bend=2e-5, bend_damping=0.05, drag=1.2, added_mass=0.27)
_THICKNESS = 0.002  # [m]
_ROUNDING = 1e-9  # [s]


class ClothSolver:
    """Our cloth, whose vertices are the nodes; those of the held edge move with the tool.

    Attributes:
        name, models: See `Solver`.
    """

    models: tuple[str, ...] = ("stretch", "bending", "damping", "air")

    def __init__(self, name: str, grip: Grip, properties: Properties):
        """Builds the cloth.

        Args:
            name: Name in tables.
            grip: Measured grip and lengths.
            properties: Properties.
        """
        self.name = name
        number = len(grip.edge)
        width = float(np.linalg.norm(grip.edge[-1] - grip.edge[0]))
        length = properties.length * float(grip.lengths[1])
        self._shape = (number, number, 3)
        self._down = np.repeat(np.linspace(0.0, length, number), number)
        fabric = Fabric(
            bend_stiffness=properties.bend,
            bend_weft=properties.bend,
            bend_damping=properties.bend_damping,
            density=properties.density,
            thickness=_THICKNESS,
            drag=properties.drag,
            added_mass=properties.added_mass,
        )
        points, triangles = rectangle(width, length, number)
        self._sheet, self._model, self._data = compiled(points, triangles, fabric)

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns nodes (f, n, n, 3) [m] in the frames of a scenario.

        Raises:
            SimulationError: If the simulation diverges.
        """
        start = np.tile(scenario.edge[0], (self._shape[0], 1))
        start[:, 2] -= self._down
        mujoco.mj_resetData(self._model, self._data)
        self._sheet.set_points(start)
        mujoco.mj_forward(self._model, self._data)
        for vertex in range(self._shape[0]):
            self._sheet.hold(vertex)
        begin = float(min(scenario.edge_times[0], scenario.times[0])) - SETTLING
        number = math.ceil((scenario.times[-1] - begin) / TIMESTEP - _ROUNDING)
        ends = begin + TIMESTEP * np.arange(1, number + 1)
        predicted = np.empty((len(scenario.times), *start.shape))
        done, earlier, before = 0, begin, start
        for end, targets in zip(ends, _edge(scenario, ends), strict=True):
            for vertex, target in enumerate(targets):
                self._sheet.drive(vertex, target, TIMESTEP)
            if not step(self._model, self._data):
                raise SimulationError(f"{self.name}: diverged at {end:.2f} s")
            points = self._sheet.points()
            while done < len(predicted) and scenario.times[done] <= end + _ROUNDING:
                share = min((scenario.times[done] - earlier) / (end - earlier), 1.0)
                predicted[done] = (1.0 - share) * before + share * points
                done += 1
            earlier, before = end, points
        return predicted.reshape(-1, *self._shape).transpose(0, 2, 1, 3)


def _edge(scenario: Scenario, times: np.ndarray) -> np.ndarray:
    """Returns vertices (n, k, 3) [m] of the held edge at times (n,) [s], between those known."""
    clipped = np.clip(times, scenario.edge_times[0], scenario.edge_times[-1])
    index = np.searchsorted(scenario.edge_times, clipped, side="right") - 1
    index = np.minimum(index, len(scenario.edge_times) - 2)
    before, after = scenario.edge_times[index], scenario.edge_times[index + 1]
    share = ((clipped - before) / (after - before))[:, None, None]
    return (1.0 - share) * scenario.edge[index] + share * scenario.edge[index + 1]
