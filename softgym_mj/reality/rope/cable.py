"""`Cable`: a rope of any length and vertex spacing, which is simulated and not rendered."""

import dataclasses
import math

import mujoco
import numpy as np

from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import check_number
from softgym_mj.reality.alone import compiled_alone, set_masses
from softgym_mj.variations.randomization import Parameter

# Substeps of a step. Bending has one sweep per substep: with 25, a stiff cable of short segments
# bends like one several times as soft.
SUBSTEPS = 50


@dataclasses.dataclass(frozen=True)
class Properties:
    """Properties of a cable.

    Attributes:
        density: Mass per length [kg/m].
        stretch: Force per strain [N].
        bend: Moment per curvature [N m^2].
        stretch_damping, bend_damping: Dashpots as a multiple of the stiffness [s].
        air_damping: Force of the air per length and speed [N s/m^2].
        radius: Half the thickness [m].
        length: Rest length between markers, relative to the measured one.
    """

    density: float
    stretch: float
    bend: float
    stretch_damping: float
    bend_damping: float
    air_damping: float
    radius: float
    length: float = 1.0

    def __post_init__(self):
        for field in dataclasses.fields(self):
            check_number(field.name, getattr(self, field.name), ge=0.0, lt=math.inf)


class Cable(Flex):
    """A cable without a skin; at rest it lies along +X from the origin."""

    parameters: tuple[Parameter, ...] = ()

    def _build(self, spacing: np.ndarray, properties: Properties):
        """Builds the cable.

        Args:
            spacing: Rest lengths (n - 1,) [m] between neighbors among n vertices.
            properties: Properties.
        """
        self._start_model("cable")
        points = np.zeros((len(spacing) + 1, 3))
        points[1:, 0] = np.cumsum(spacing)
        indices = np.arange(len(points))
        elements = np.column_stack([indices[:-1], indices[1:]])
        flexcomp = self._add_flexcomp(points, elements, radius=properties.radius)
        flexcomp.mass = properties.density * points[-1, 0]
        flexcomp.contact.friction = [0.0]
        self._properties = properties
        self._set_parameters()
        self._instance.add("config", key="substeps", value=str(SUBSTEPS))

    def _set_parameters(self):
        self._set_material(
            stretch=self._properties.stretch,
            bend=self._properties.bend,
            stretch_damping=self._properties.stretch_damping,
            bend_damping=self._properties.bend_damping,
            friction=0.0,
        )

    def after_compile(self, physics, random_state):
        super().after_compile(physics, random_state)
        model, data = physics.model.ptr, physics.data.ptr
        # MuJoCo gives all vertices the same mass: here each has half of the segments beside it.
        share = np.convolve(self.rest_lengths, [0.5, 0.5])
        dofs = self._dofs[:, None] + np.arange(3)
        model.dof_damping[dofs] = self._properties.air_damping * share[:, None]
        set_masses(self, model, data, self._properties.density * share)


def compiled(
    spacing: np.ndarray, properties: Properties
) -> tuple[Cable, mujoco.MjModel, mujoco.MjData]:
    """Compiles a cable in the air, and nothing else."""
    cable = Cable(spacing, properties)
    return cable, *compiled_alone(cable)
