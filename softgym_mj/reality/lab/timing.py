"""Time steps of the lab, so fine that a sheet has the nominal stiffness of its fabric."""

import dataclasses
import math

from softgym_mj.cloth import solver
from softgym_mj.entities.fabric import Fabric

# Stiffness times substep^2 over mass, of edges and of hinges, below which the solver's rows
# converge in one iteration.
_SOFT_EDGE, _SOFT_HINGE = 0.05, 0.1
_HINGE_MASSES = 16.0  # Largest sum of squares of a hinge's weights.
_MOST_SUBSTEPS = 100  # Limited by the single precision of displacements within a step.
# Least number: peaks of the kinetic energy are detected at the end of a step.
_STEPS_OF_PERIOD = 50.0
_DAMPED = 5.0  # Longest damping time in substeps: slower ones creep for long.


@dataclasses.dataclass(frozen=True)
class Timing:
    """Time resolution: `substeps` of a step of `timestep` [s], and the longest damping time [s]."""

    timestep: float
    substeps: int
    damping: float

    @property
    def substep(self) -> float:
        """Substep [s]."""
        return self.timestep / self.substeps

    def applied(self, fabric: Fabric) -> Fabric:
        """Returns the fabric with damping times of at most `damping`; statics do not change."""
        return dataclasses.replace(
            fabric,
            stretch_damping=min(fabric.stretch_damping, self.damping),
            bend_damping=min(fabric.bend_damping, self.damping),
        )


USUAL = Timing(solver.TIMESTEP, 25, math.inf)  # Time resolution of the tasks.


def converged(fabric: Fabric, spacing: float, period: float = math.inf) -> Timing:
    """Returns time steps for which a mesh of a vertex spacing [m] has the fabric's stiffness.

    Steps are also limited to a share of `period` [s].
    """
    mass = fabric.density * spacing**2
    edge = math.sqrt(_SOFT_EDGE * mass / fabric.stretch_stiffness)
    stiffest = max(fabric.bend_stiffness, fabric.bend_weft, fabric.bend_bias)
    hinge = spacing * math.sqrt(_SOFT_HINGE * mass / (_HINGE_MASSES * stiffest))
    substep = min(edge, hinge, USUAL.substep)
    longest = min(USUAL.timestep, period / _STEPS_OF_PERIOD)
    substeps = min(math.ceil(longest / substep), _MOST_SUBSTEPS)
    return Timing(min(longest, substeps * substep), substeps, _DAMPED * substep)
