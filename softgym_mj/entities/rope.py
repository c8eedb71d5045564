"""`Rope`: a cord of 0.5 m as a one-dimensional MuJoCo flex."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from softgym_mj.domain import Parameter, scaled, shifted, turned
from softgym_mj.entities.contact import FlexContact
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import check_name

# [m] Natural length. SoftGym calls this straight; its own relaxed rope is 7.5 % longer.
LENGTH = 0.5
# Number of vertices; SoftGym has 41. Neighbours must be two radii apart, or else every second edge
# of a straight rope would collide: the "accurate" rope is thinner, 8.3 mm instead of 12.5 mm.
FIDELITIES = {"fast": 31, "default": 41, "accurate": 61}
NUM_KEY_POINTS = 10
RADIUS = 0.00625  # [m] SoftGym's drawn radius; here it is the contact radius too.
MASS = 0.05  # [kg], 0.1 kg/m: a cotton cord of this diameter.
# [Pa]; bending rigidity E pi r^4 / 4 = 1.2e-5 N m^2, a soft cotton cord. With ten times more a
# third of the twisted initial states spring back to nearly straight.
YOUNG = 1e4
DAMPING = 0.01  # [s], Rayleigh.
FRICTION = 1.0  # SoftGym's friction of the rope against shapes and floor.
TIMESTEP = 0.005  # [s]: at 1 m/s a vertex moves 5 mm a step, less than the radius.

# Stretch is an edge equality. Direct (stiffness, damping) of a constraint that removes nearly all
# of its error within a step; with the default solref the rope stretches by half at picker speed.
EDGE_SOLREF = (-24000.0, -200.0)
EDGE_SOLIMP = (0.99, 0.999, 0.001)

COLOR = (0.0, 0.5, 1.0, 1.0)  # SoftGym's blue.


@dataclasses.dataclass(frozen=True)
class Solver:
    """A solver of MuJoCo, and when it stops."""

    name: str
    iterations: int
    tolerance: float


# By what keeps the rope from passing through itself. Newton is twice as fast as CG on a rope alone,
# and exact; CG is what cloth needs, and several times faster on both together. There a tolerance of
# 1e-4, enough for cloth, lets a dragged rope stretch half as much again.
SOLVERS = {"mujoco": Solver("Newton", 50, 1e-6), "plugin": Solver("CG", 200, 1e-5)}

PARAMETERS = (
    scaled(
        "bend_stiffness", "N m^2", YOUNG * math.pi * RADIUS**4 / 4, 2.0, 5.0, "moment per curvature"
    ),
    scaled("density", "kg/m", MASS / LENGTH, 1.4, 2.0, "mass of a unit of length"),
    scaled("friction", "", FRICTION, 1.2, 1.6, "on the floor and on itself"),
    shifted("hue", "deg", 20.0, 90.0, "by which colours are turned"),
)


class Rope(Flex):
    """A rope; at rest it lies along +X, centred at the origin."""

    # Of a taut rope less than a cloth's: twice as much stretches pieces between two pickers by 8 %.
    hold_stretch = 0.05

    def _build(
        self,
        fidelity: str = "default",
        self_contact: FlexContact | None = None,
        color: Sequence[float] = COLOR,
        name: str = "rope",
    ):
        """Builds the rope.

        Args:
            fidelity: "fast", "default" or "accurate": 31, 41 or 61 vertices.
            self_contact: the contact that it shares with other flexes; None for MuJoCo's flex
                self-collision, with which it does not feel other flexes.
            color: (r, g, b, a) in 0..1.
            name: model name.

        Raises:
            UnknownNameError: if there is no such fidelity.
        """
        check_name("fidelity", fidelity, FIDELITIES)
        count = FIDELITIES[fidelity]
        radius = min(RADIUS, LENGTH / (count - 1) / 2)
        self._color = tuple(color)
        if self_contact is not None:
            self._share(self_contact)
        solver = SOLVERS[self._self_contact]
        self._start_model(name)
        option = self._mjcf_root.option
        option.integrator, option.solver, option.jacobian = "discrete", solver.name, "sparse"
        option.timestep = TIMESTEP
        option.iterations, option.tolerance = solver.iterations, solver.tolerance
        self._mjcf_root.size.memory = "16M"
        points = np.zeros((count, 3))
        points[:, 0] = np.linspace(-LENGTH / 2, LENGTH / 2, count)
        elements = np.column_stack([np.arange(count - 1), np.arange(1, count)])
        flexcomp = self._add_flexcomp(points, elements, radius=radius)
        flexcomp.elasticity.poisson = 0.0
        flexcomp.elasticity.damping = DAMPING
        flexcomp.edge.equality = "true"
        flexcomp.edge.solref = EDGE_SOLREF
        flexcomp.edge.solimp = EDGE_SOLIMP
        if self_contact is None:
            flexcomp.contact.selfcollide = "auto"
        flexcomp.contact.condim = 3
        self._set_parameters()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return PARAMETERS

    def _set_parameters(self):
        bend, density, friction, hue = (self._values[parameter.name] for parameter in PARAMETERS)
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        stiffer = bend / (YOUNG * math.pi * RADIUS**4 / 4)
        flexcomp.elasticity.young = YOUNG * stiffer * (RADIUS / self.radius) ** 4
        flexcomp.mass = density * LENGTH
        flexcomp.contact.friction = [friction]
        flexcomp.rgba = turned(self._color, hue)

    @property
    def timestep(self) -> float:
        return TIMESTEP

    @property
    def ends(self) -> tuple[int, int]:
        """Vertex indices of the two ends."""
        return 0, self.num_vertices - 1

    @property
    def key_points(self) -> np.ndarray:
        """Vertex indices (10,), evenly spaced from end to end; SoftGym's are 0, 4, ..., 32, 40."""
        return np.round(np.linspace(0, self.num_vertices - 1, NUM_KEY_POINTS)).astype(int)

    def straight(self) -> np.ndarray:
        """Vertex positions (num_vertices, 3) [m] of the straight rope on the floor."""
        return self._rest_points + np.array([0.0, 0.0, self.radius])

    def end_distance(self) -> float:
        """Distance [m] between the two end vertices."""
        first, last = self.ends
        return math.dist(self.vertex(first), self.vertex(last))
