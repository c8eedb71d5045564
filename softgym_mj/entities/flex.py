"""`Flex`: a deformable object of point-mass vertices, the base of `Sheet` and `Rope`."""

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth import solver
from softgym_mj.entities.entity import Entity
from softgym_mj.entities.mesh_distances import MeshDistances
from softgym_mj.exceptions import InvalidArgumentError, check_number, set_by_compile
from softgym_mj.metrics import Array, lengths, namespace, taken
from softgym_mj.validation import as_finite
from softgym_mj.variations.parametric import Parametric

# [kg] Mass of a held vertex. FleX gives held particles an infinite mass; with 10 kg the pull of the
# cloth (5 N) moves a held vertex by 0.05 mm in a step, and the solver stays well conditioned (with
# 100 kg it does not).
HELD_MASS = 10.0

# Contact bits: objects and the floor collide with each other (1); grippers (2) collide with objects
# only, neither with the floor nor with each other.
OBJECT_CONTACT, GRIPPER_CONTACT = 1, 2

Color = tuple[float, float, float, float]  # (r, g, b, a) in 0..1.
FLEX = "flex"  # Name of the flexcomp, hence of its vertex bodies: flex_0, flex_1, ...


def slide_views(model, data, bodies: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Returns views (n, 3) of qpos [m] and qvel [m/s] of n consecutive bodies with three slides."""
    qpos = model.jnt_qposadr[model.body_jntadr[bodies]]
    qvel = model.body_dofadr[bodies]
    if np.any(np.diff(qpos) != 3) or np.any(np.diff(qvel) != 3):
        raise RuntimeError("vertices and pickers are expected to have consecutive slide joints")
    count = 3 * len(bodies)
    return (
        data.qpos[qpos[0] : qpos[0] + count].reshape(-1, 3),
        data.qvel[qvel[0] : qvel[0] + count].reshape(-1, 3),
    )


def is_overloaded(force: Array, behind: Array, most_force: Array, most_behind: Array) -> Array:
    """Returns whether (...) held vertices are released under load.

    Args:
        force: pull on the gripper (...) [N].
        behind: tracking error, the distance from the vertex's target (...) [m].
        most_force, most_behind: limits of both (...).
    """
    return (force > most_force) | (behind > most_behind)


def edge_strains(points: Array, ends: Array, rest_lengths: Array) -> Array:
    """Returns relative elongations (..., m) of edges: 0 at rest, negative when compressed.

    Args:
        points: positions of vertices (..., n, 3) [m].
        ends: vertices of the edges (..., m, 2).
        rest_lengths: rest lengths of the edges (..., m) [m].
    """
    difference = taken(points, ends[..., 0]) - taken(points, ends[..., 1])
    return lengths(difference) / rest_lengths - 1.0


def highest_speed(velocities: Array) -> Array:
    """Returns the speed (...) [m/s] of the fastest of vertices with velocities (..., n, 3)."""
    xp = namespace(velocities)
    return xp.sqrt(xp.max(xp.sum(velocities**2, axis=-1), axis=-1))


class Flex(Entity, Parametric):
    """A flexcomp of free vertices (three world-aligned slides each), in the order of `points`.

    Attach it with `arena.attach` at the world frame: vertex positions are read from `qpos`, which
    is always current, even between a step and the next kinematics. The entity is bound to the
    physics into which it was last compiled.

    Attributes:
        timestep: physics step [s].
        radius: contact radius [m]: the height of vertices that rest on the floor.
        vertex_ids: indices (num_points,) of the vertices among all flex vertices of the model.
        edges: vertex indices (num_edges, 2) of the mesh edges, `rest_lengths` (num_edges,) at rest
            [m].
        origin: vertex positions (num_points, 3) for slides of 0 [m].
        mesh_distances: distances between vertices along these edges.
        slides, slide_velocities: (num_points, 3) [m], [m/s], views of the simulation state.
        arrays: arrays that depend on the size, by name; empty except for a `Cloth`.
    """

    timestep = solver.TIMESTEP
    # Relative elongation of the path along the mesh up to which two held vertices may be moved
    # apart. Cloth that hangs or is drawn taut stretches by some per cent and stays held. What two
    # pickers pull apart at 1 m/s each stretches no more than by the jerk of one alone, not 20-fold.
    hold_stretch = 0.1
    # [N] Largest mean pull of a held vertex on its gripper over a step: what two pads that press
    # with 10 N each hold at a friction of 0.5. A cloth's edges stretch by 15 % then.
    hold_force = 10.0
    # [m] Largest distance of a held vertex from its target, including the 17 mm that a picker moves
    # in a step: a vertex further behind, under a pile of cloth, does not come free.
    max_tracking_error = 0.1

    vertex_ids: np.ndarray = set_by_compile()
    origin: np.ndarray = set_by_compile()
    slides: np.ndarray = set_by_compile()
    slide_velocities: np.ndarray = set_by_compile()
    edges: np.ndarray = set_by_compile()
    rest_lengths: np.ndarray = set_by_compile()
    mesh_distances: MeshDistances = set_by_compile()
    _model: mujoco.MjModel = set_by_compile()
    _dofs: np.ndarray = set_by_compile()

    def _start_model(self, name: str) -> None:
        """Starts the model; to be called first in a subclass's `_build`."""
        self._mjcf_root = mjcf.RootElement(model=name)
        option = self._mjcf_root.option
        option.timestep = solver.TIMESTEP
        option.jacobian = "sparse"
        # Implicit for the servos of arms; it does not affect flexes.
        option.integrator = "discrete"
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
        """Returns the height [m] of a vertex that rests on the floor."""
        return self.radius

    def _add_flexcomp(
        self, points: np.ndarray, elements: np.ndarray, radius: float, **attributes
    ) -> mjcf.Element:
        """Replaces the flexcomp by one with `points` (n, 3) [m] and `elements` (m, dim + 1)."""
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

    def _set_material(self, **properties: Any) -> None:
        """Sets `solver.Material`'s attributes except for contact bits."""
        material = solver.Material(
            contype=OBJECT_CONTACT, conaffinity=OBJECT_CONTACT | GRIPPER_CONTACT, **properties
        )
        solver.set_material(self._instance, material)

    @property
    def physical_parameters(self) -> dict[str, dict[str, object]]:
        """Parameters that determine the motion besides the mesh: mass, material, friction."""
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
        self._flex = flex
        self._model, self._data = model, data
        solver.forget_damping(model)
        edges = slice(model.flex_edgeadr[flex], model.flex_edgeadr[flex] + model.flex_edgenum[flex])
        self.edges = np.array(model.flex_edge[edges], int, order="F")  # For `edge_strain`.
        self.rest_lengths = np.array(model.flexedge_length0[edges])
        self._held = {}
        self.mesh_distances = MeshDistances(self.num_points, self.edges, self.rest_lengths)

    def points(self) -> np.ndarray:
        """Returns current vertex positions (num_points, 3) [m] in the world, a fresh array."""
        return self.origin + self.slides

    def displacements_from(self, point: np.ndarray) -> np.ndarray:
        """Returns vertex positions (..., num_points, 3) [m] relative to points (..., 3)."""
        return self.slides + (self.origin - point[..., None, :])

    def vertex(self, index: int) -> np.ndarray:
        """Returns the current position (3,) [m] of one vertex."""
        return self.origin[index] + self.slides[index]

    def velocities(self) -> np.ndarray:
        """Returns current vertex velocities (num_points, 3) [m/s], a fresh array."""
        return self.slide_velocities.copy()

    def set_points(self, positions: np.ndarray, velocities: np.ndarray | float = 0.0) -> None:
        """Places the vertices: `positions` (num_points, 3) [m], `velocities` [m/s] alike.

        A velocity (3,) is that of all vertices.

        Raises:
            InvalidArgumentError: for another shape, or a number that is not finite.
        """
        shape = (self.num_points, 3)
        positions = as_finite("positions", positions, shape)
        velocities = as_finite("velocities", velocities, shape, (3,), ())
        self.slides[:] = positions - self.origin
        self.slide_velocities[:] = velocities

    def edge_strain(self) -> np.ndarray:
        """Returns relative elongations (num_edges,) of edges: 0 at rest, < 0 if compressed."""
        return edge_strains(self.points(), self.edges, self.rest_lengths)

    # ------------------------------------------------------------------ twist

    @property
    def twist_angle(self) -> float:
        """Twist [rad] of a rope: right-handed roll of the last edge relative to the first one.

        It is 0 unless both end vertices are held, and follows their rope's writhe then.

        Raises:
            InvalidArgumentError: If the flex does not twist.
        """
        return float(solver.twist_angle(self._model, self._data, self._flex)[0])

    def turn_end(self, index: int, angle: float) -> None:
        """Rolls the frame of a held end by `angle` [rad] about the rope's direction at that end.

        Grips hold frames without roll otherwise. The direction leads from the first vertex to the
        last one.

        Args:
            index: 0 or `num_points - 1`.
            angle: Right-handed angle.

        Raises:
            InvalidArgumentError: If the flex does not twist, the vertex is no held end, or the
                angle is not finite.
        """
        twist = solver.twist_angle(self._model, self._data, self._flex)
        ends = {0: -1.0, self.num_points - 1: 1.0}
        if index not in ends or index not in self._held:
            raise InvalidArgumentError("index", index, [end for end in ends if end in self._held])
        check_number("angle", angle, gt=-math.inf, lt=math.inf)
        twist += ends[index] * angle

    # ------------------------------------------------------------------ holding vertices

    def hold(self, index: int) -> None:
        """Makes a vertex follow `drive` only, not the physics."""
        if index not in self._held:
            dof = self._dofs[index]
            self._held[index] = np.array(self._dof_mass[dof : dof + 3])
            # The engine reads the inertia of a simple body from dof_M0; nothing else uses it.
            self._dof_mass[dof : dof + 3] = HELD_MASS

    def release(self, index: int) -> None:
        """Restores the mass of a held vertex; it keeps the velocity of the last `drive`."""
        dof = self._dofs[index]
        self._dof_mass[dof : dof + 3] = self._held.pop(index)

    def release_all(self) -> None:
        """Releases all held vertices."""
        for index in list(self._held):
            self.release(index)

    def largest_gap(self, first: int, second: int) -> float:
        """Returns the largest distance [m] of two held vertices; infinite if nothing connects them.

        It is their distance along the mesh at rest times 1 + `hold_stretch`.
        """
        return (1.0 + self.hold_stretch) * self.mesh_distances.between(first, second)

    def holding_force(self, index: int) -> float:
        """Returns the mean force [N] of a held vertex on its gripper in the last physics step."""
        return solver.holding_force(self._model, self._data, int(self.vertex_ids[index]))

    def is_overloaded(self, index: int, goal: np.ndarray) -> bool:
        """Returns whether a held vertex with target `goal` (3,) [m] is released under load.

        Its pull exceeds `hold_force`, or its tracking error `max_tracking_error`.
        """
        behind = math.dist(goal, self.vertex(index))
        return is_overloaded(
            self.holding_force(index), behind, self.hold_force, self.max_tracking_error
        )

    def drive(self, index: int, target: np.ndarray, duration: float) -> None:
        """Moves a held vertex to `target` (3,) [m], reached after `duration` [s].

        The velocity is recomputed from the position at every call, so errors do not accumulate.
        """
        self.slide_velocities[index] = (target - self.origin[index] - self.slides[index]) / duration
