"""How fine time is in the lab, so that a sheet resists as its fabric says."""

import dataclasses
import math

from softgym_mj.cloth import solver
from softgym_mj.entities.fabric import Fabric

# Rows of the solver that are this much softer than their vertices are light need no more than their
# one turn: stiffness times substep^2 over mass, of edges and of hinges.
_SOFT_EDGE, _SOFT_HINGE = 0.05, 0.1
_HINGE_MASSES = 16.0  # Sum of squares of a hinge's weights, at most.
_MOST_SUBSTEPS = 100  # Displacements within a step are in single precision.
_STEPS_OF_PERIOD = 50.0  # At least: when it begins to slow down is seen at the end of a step.
_DAMPED = 5.0  # Substeps that dampings may last: slower ones creep for long.


@dataclasses.dataclass(frozen=True)
class Timing:
    """How fine time is: `substeps` of a step of `timestep` [s], and how long dampings last [s]."""

    timestep: float
    substeps: int
    damping: float

    @property
    def substep(self) -> float:
        """[s]"""
        return self.timestep / self.substeps

    def applied(self, fabric: Fabric) -> Fabric:
        """The fabric with dampings of at most `damping`: what hangs still does not feel them."""
        return dataclasses.replace(
            fabric,
            stretch_damping=min(fabric.stretch_damping, self.damping),
            bend_damping=min(fabric.bend_damping, self.damping),
        )


USUAL = Timing(solver.TIMESTEP, 25, math.inf)  # Of the tasks.


def converged(fabric: Fabric, spacing: float, period: float = math.inf) -> Timing:
    """So fine that a mesh with so much between its vertices [m] resists as the fabric says.

    Steps are no longer than a share of `period` [s], too.
    """
    mass = fabric.density * spacing**2
    edge = math.sqrt(_SOFT_EDGE * mass / fabric.stretch_stiffness)
    stiffest = max(fabric.bend_stiffness, fabric.bend_weft, fabric.bend_bias)
    hinge = spacing * math.sqrt(_SOFT_HINGE * mass / (_HINGE_MASSES * stiffest))
    substep = min(edge, hinge, USUAL.substep)
    longest = min(USUAL.timestep, period / _STEPS_OF_PERIOD)
    substeps = min(math.ceil(longest / substep), _MOST_SUBSTEPS)
    return Timing(min(longest, substeps * substep), substeps, _DAMPED * substep)
