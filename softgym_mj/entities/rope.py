"""`Rope`: a cord of 0.5 m as a one-dimensional MuJoCo flex."""

import math

import numpy as np

from softgym_mj.entities.flex import Flex

# [m] Natural length. SoftGym calls this straight; its own relaxed rope is 7.5 % longer.
LENGTH = 0.5
NUM_VERTICES = 41  # SoftGym's particle count.
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

# SoftGym takes 0, 4, ..., 32, 40; these are evenly spaced as the paper says.
KEY_POINTS = np.round(np.linspace(0, NUM_VERTICES - 1, 10)).astype(int)

COLOR = (0.0, 0.5, 1.0, 1.0)  # SoftGym's blue.


class Rope(Flex):
    """A rope of 41 vertices; at rest it lies along +X, centred at the origin."""

    def _build(self, name: str = "rope"):
        self._start_model(name)
        option = self._mjcf_root.option
        # Newton is twice as fast as CG on a model this small, and exact.
        option.integrator, option.solver, option.jacobian = "discrete", "Newton", "sparse"
        option.timestep = TIMESTEP
        option.iterations, option.tolerance = 50, 1e-6
        self._mjcf_root.size.memory = "16M"
        points = np.zeros((NUM_VERTICES, 3))
        points[:, 0] = np.linspace(-LENGTH / 2, LENGTH / 2, NUM_VERTICES)
        elements = np.column_stack([np.arange(NUM_VERTICES - 1), np.arange(1, NUM_VERTICES)])
        flexcomp = self._add_flexcomp(points, elements, radius=RADIUS, mass=MASS, rgba=COLOR)
        flexcomp.elasticity.young = YOUNG
        flexcomp.elasticity.poisson = 0.0
        flexcomp.elasticity.damping = DAMPING
        flexcomp.edge.equality = "true"
        flexcomp.edge.solref = EDGE_SOLREF
        flexcomp.edge.solimp = EDGE_SOLIMP
        flexcomp.contact.selfcollide = "auto"
        flexcomp.contact.condim = 3
        flexcomp.contact.friction = [FRICTION]

    @property
    def timestep(self) -> float:
        return TIMESTEP

    @property
    def ends(self) -> tuple[int, int]:
        """Vertex indices of the two ends."""
        return 0, self.num_vertices - 1

    def straight(self) -> np.ndarray:
        """Vertex positions (num_vertices, 3) [m] of the straight rope on the floor."""
        return self._rest_points + np.array([0.0, 0.0, RADIUS])

    def end_distance(self) -> float:
        """Distance [m] between the two end vertices."""
        first, last = self.ends
        return math.dist(self.vertex(first), self.vertex(last))
