"""`ClothSolver`: predicts recordings of a cloth with this package's cloth."""

import dataclasses
import math

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import SimulationError, check_number
from softgym_mj.reality.cloth.scenario import Grip, Scenario
from softgym_mj.reality.meshes import grid
from softgym_mj.reality.replay import Hold, replay

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
        self._mesh = grid(width, properties.length * float(grip.lengths[1]), number, number)
        self._shape = (number, number, 3)
        self._fabric = Fabric(
            bend_stiffness=properties.bend,
            bend_weft=properties.bend,
            bend_damping=properties.bend_damping,
            density=properties.density,
            thickness=_THICKNESS,
            drag=properties.drag,
            added_mass=properties.added_mass,
        )

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns nodes (f, n, n, 3) [m] in the frames of a scenario.

        Raises:
            SimulationError: If the simulation diverges.
        """
        down = self._mesh.points[: self._shape[0], 1].max() - self._mesh.points[:, 1]
        start = np.tile(scenario.edge[0], (self._shape[0], 1))
        start[:, 2] -= down

        def path(times: np.ndarray) -> np.ndarray:
            clipped = np.clip(times, scenario.edge_times[0], scenario.edge_times[-1])
            index = np.searchsorted(scenario.edge_times, clipped, side="right") - 1
            index = np.minimum(index, len(scenario.edge_times) - 2)
            before, after = scenario.edge_times[index], scenario.edge_times[index + 1]
            share = ((clipped - before) / (after - before))[:, None, None]
            return (1.0 - share) * scenario.edge[index] + share * scenario.edge[index + 1]

        moved = replay(
            self._mesh,
            self._fabric,
            [Hold(tuple(range(self._shape[0])), path)],
            scenario.times,
            start=start,
            begin=float(min(scenario.edge_times[0], scenario.times[0])) - SETTLING,
            floor=None,
            by_area=True,
            watched=False,
        )
        if moved.failures:
            failure = moved.failures[0]
            raise SimulationError(f"{self.name}: {failure.kind} at {failure.time:.2f} s")
        return moved.positions.reshape(-1, *self._shape).transpose(0, 2, 1, 3)
