"""`Flex`: a deformable object made of point-mass vertices, the base of `Sheet` and `Rope`."""

import math
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth import solver
from softgym_mj.entities.entity import Entity
from softgym_mj.entities.ways import Ways
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array, lengths, namespace, taken
from softgym_mj.variations.parametric import Parametric

# Mass [kg] that a vertex has while something holds it. FleX gives held particles an infinite mass;
# with 10 kg the pull of the cloth (5 N) moves a held vertex by 0.05 mm in a step, and the solver
# stays well conditioned (with 100 kg it does not).
HELD_MASS = 10.0

# Contact bits: objects and the floor collide with each other (1); grippers (2) collide with objects
# only, neither with the floor nor with each other.
OBJECT_CONTACT, GRIPPER_CONTACT = 1, 2

Color = tuple[float, float, float, float]  # (r, g, b, a) in 0..1.
FLEX = "flex"  # Name of the flexcomp, hence of its vertex bodies: flex_0, flex_1, ...


def slide_views(model, data, bodies: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Views (n, 3) of qpos [m] and qvel [m/s] of n bodies with three slides each, in a row."""
    qpos = model.jnt_qposadr[model.body_jntadr[bodies]]
    qvel = model.body_dofadr[bodies]
    if np.any(np.diff(qpos) != 3) or np.any(np.diff(qvel) != 3):
        raise RuntimeError("vertices and pickers are expected to have consecutive slide joints")
    count = 3 * len(bodies)
    return (
        data.qpos[qpos[0] : qpos[0] + count].reshape(-1, 3),
        data.qvel[qvel[0] : qvel[0] + count].reshape(-1, 3),
    )


def pulls_out(force: Array, behind: Array, most_force: Array, most_behind: Array) -> Array:
    """Whether held vertices slip out of their grippers (...).

    Args:
        force: with which they pull (...) [N].
        behind: how far they are behind where they are taken to (...) [m].
        most_force, most_behind: what a grip can take (...).
    """
    return (force > most_force) | (behind > most_behind)


def edge_strains(points: Array, ends: Array, rest_lengths: Array) -> Array:
    """Relative elongations (..., m) of edges: 0 at rest, negative when compressed.

    Args:
        points: positions of vertices (..., n, 3) [m].
        ends: vertices of the edges (..., m, 2).
        rest_lengths: of the edges (..., m) [m].
    """
    difference = taken(points, ends[..., 0]) - taken(points, ends[..., 1])
    return lengths(difference) / rest_lengths - 1.0


def highest_speed(velocities: Array) -> Array:
    """Speed (...) [m/s] of the fastest of vertices with velocities (..., n, 3)."""
    xp = namespace(velocities)
    return xp.sqrt(xp.max(xp.sum(velocities**2, axis=-1), axis=-1))


class Flex(Entity, Parametric):
    """A flexcomp of free vertices (three world-aligned slides each), in the order of `points`.

    Attach it with `arena.attach` at the world frame: vertex positions are read straight from
    `qpos`, which is always current, even between a step and the next kinematics. The entity is
    bound to the physics it was last compiled into.

    Attributes:
        timestep: physics step [s].
        radius: contact radius [m]: the height of the vertices of an object that lies on the floor.
        vertex_ids: indices (num_points,) of the vertices among all flex vertices of the model.
        edges: vertex indices (num_edges, 2) of the mesh edges, `rest_lengths` (num_edges,) at rest
            [m].
        origin: where vertices are (num_points, 3) when their slides are 0 [m].
        ways: along these edges.
        slides, slide_velocities: (num_points, 3) [m], [m/s], views of what is simulated.
        arrays: what measures need to know that depends on the size, by name: nothing, but for a
            `Cloth`.
    """

    timestep = solver.TIMESTEP
    # By which share of their way along the mesh two held vertices may be moved further apart. Cloth
    # that hangs or is drawn taut stretches by some per cent, and keeps its holds. What two pickers
    # pull apart at 1 m/s each is stretched no more than by the jerk of one alone, not 20-fold.
    hold_stretch = 0.1
    # [N] With which a held vertex may pull at its gripper, on average over a step: what two pads
    # that press with 10 N each hold at a friction of 0.5. A cloth's edges stretch by 15 % then.
    hold_force = 10.0
    # [m] By which a held vertex may be behind where it is taken to, 17 mm of which are a picker's
    # way in a step: what is further behind, under a pile of cloth, does not come free.
    hold_lag = 0.1

    def _start_model(self, name: str) -> None:
        """To be called first in a subclass's `_build`."""
        self._mjcf_root = mjcf.RootElement(model=name)
        option = self._mjcf_root.option
        option.timestep = solver.TIMESTEP
        option.jacobian = "sparse"
        option.integrator = "discrete"  # Implicit in the servos of arms; flexes do not mind.
        self._mjcf_root.size.memory = "16M"
        self._instance = solver.add_instance(self._mjcf_root)
        self.arrays: dict[str, np.ndarray] = {}
        self._rest_points = np.zeros((0, 3))
        self.radius = 0.0
        self._held: dict[int, np.ndarray] = {}

    @property
    def num_points(self) -> int:
        """Number of vertices."""
        return len(self._rest_points)

    def resting_height(self, index: int) -> float:
        """Height [m] of a vertex that rests on the floor."""
        return self.radius

    def _add_flexcomp(
        self, points: np.ndarray, elements: np.ndarray, radius: float, **attributes
    ) -> mjcf.Element:
        """(Re)places the flexcomp by one with `points` (n, 3) [m] and `elements` (m, dim + 1)."""
        self._mjcf_root.worldbody.flexcomp.clear()
        self._rest_points, self.radius = points, radius
        flexcomp = self._mjcf_root.worldbody.add(
            "flexcomp",
            name=FLEX,
            type="direct",
            dim=elements.shape[1] - 1,
            point=points.ravel(),
            element=elements.ravel(),
            radius=radius,
            **attributes,
        )
        solver.leave_to_plugin(flexcomp, self._instance)
        return flexcomp

    def _set_material(self, **properties: float) -> None:
        """Says what it is made of: `solver.Material`'s attributes, but for what it touches."""
        material = solver.Material(
            contype=OBJECT_CONTACT, conaffinity=OBJECT_CONTACT | GRIPPER_CONTACT, **properties
        )
        solver.set_material(self._instance, material)

    @property
    def physical_parameters(self) -> dict[str, dict[str, object]]:
        """What determines the motion besides the mesh: mass, what it is made of, friction."""
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        friction = flexcomp.contact.friction
        return {
            "body": {"radius": flexcomp.radius, "mass": flexcomp.mass},
            "material": {config.key: config.value for config in self._instance.config},
            "contact": {"friction": None if friction is None else friction.tolist()},
        }

    # ------------------------------------------------------------------ simulation

    def after_compile(self, physics, random_state):
        model, data = physics.model.ptr, physics.data.ptr
        name = f"{self._mjcf_root.model}/{FLEX}"
        flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name)
        first, count = model.flex_vertadr[flex], model.flex_vertnum[flex]
        self.vertex_ids = np.arange(first, first + count)
        bodies = model.flex_vertbodyid[first : first + count]
        self._dofs = np.array(model.body_dofadr[bodies])
        self.origin = np.array(model.body_pos[bodies])
        self.slides, self.slide_velocities = slide_views(model, data, bodies)
        self._dof_mass = model.dof_M0
        self._model, self._data = model, data
        solver.forget_damping(model)
        edges = slice(model.flex_edgeadr[flex], model.flex_edgeadr[flex] + model.flex_edgenum[flex])
        self.edges = np.array(model.flex_edge[edges])
        self.rest_lengths = np.array(model.flexedge_length0[edges])
        self._held, self.ways = {}, Ways(self.num_points, self.edges, self.rest_lengths)

    def points(self) -> np.ndarray:
        """Current vertex positions (num_points, 3) [m] in the world frame, a fresh array."""
        return self.origin + self.slides

    def offsets(self, point: np.ndarray) -> np.ndarray:
        """Vertex positions (..., num_points, 3) [m] relative to points (..., 3)."""
        return self.slides + (self.origin - point[..., None, :])

    def vertex(self, index: int) -> np.ndarray:
        """Current position (3,) [m] of one vertex."""
        return self.origin[index] + self.slides[index]

    def velocities(self) -> np.ndarray:
        """Current vertex velocities (num_points, 3) [m/s], a fresh array."""
        return self.slide_velocities.copy()

    def set_points(self, positions: np.ndarray, velocities: np.ndarray | float = 0.0) -> None:
        """Places the vertices: `positions` (num_points, 3) [m], `velocities` alike [m/s]."""
        positions = np.asarray(positions, float).reshape(-1, 3)
        if positions.shape != (self.num_points, 3) or not np.isfinite(positions).all():
            raise InvalidArgumentError(
                "positions", positions.shape, f"finite array of shape ({self.num_points}, 3)"
            )
        self.slides[:] = positions - self.origin
        self.slide_velocities[:] = velocities

    def edge_strain(self) -> np.ndarray:
        """Relative elongation (num_edges,) of every edge: 0 at rest, negative when compressed."""
        return edge_strains(self.points(), self.edges, self.rest_lengths)

    # ------------------------------------------------------------------ holding vertices

    def hold(self, index: int) -> None:
        """Makes a vertex follow `drive` alone: physics no longer moves it."""
        if index not in self._held:
            dof = self._dofs[index]
            self._held[index] = np.array(self._dof_mass[dof : dof + 3])
            # For a simple body the engine takes the inertia from dof_M0; nothing else reads it.
            self._dof_mass[dof : dof + 3] = HELD_MASS

    def release(self, index: int) -> None:
        """Gives a held vertex its own mass back; it keeps the velocity it was driven at."""
        dof = self._dofs[index]
        self._dof_mass[dof : dof + 3] = self._held.pop(index)

    def release_all(self) -> None:
        """Releases every vertex that is held."""
        for index in list(self._held):
            self.release(index)

    def largest_gap(self, first: int, second: int) -> float:
        """How far apart [m] two held vertices may be moved; infinite if nothing connects them.

        It is the shortest way along the edges of the mesh at rest, and `hold_stretch` more.
        """
        return (1.0 + self.hold_stretch) * self.ways.between(first, second)

    def holding_force(self, index: int) -> float:
        """The force [N] of a held vertex on its gripper, averaged over the last physics step."""
        return solver.holding_force(self._model, self._data, int(self.vertex_ids[index]))

    def slips(self, index: int, goal: np.ndarray) -> bool:
        """Whether a held vertex slips out of its gripper, which takes it to `goal` (3,) [m].

        It pulls with more than `hold_force`, or is more than `hold_lag` behind.
        """
        behind = math.dist(goal, self.vertex(index))
        return pulls_out(self.holding_force(index), behind, self.hold_force, self.hold_lag)

    def drive(self, index: int, target: np.ndarray, duration: float) -> None:
        """Sets a held vertex on its way to `target` (3,) [m], reached after `duration` [s].

        The velocity is recomputed from the position at every call, so errors do not add up.
        """
        self.slide_velocities[index] = (target - self.origin[index] - self.slides[index]) / duration
