"""Newton's solvers of cloth: VBD and Style3D, on a CPU."""

import functools
from collections.abc import Callable

import newton
import numpy as np
import warp as wp
from newton import ParticleFlags
from newton.solvers import SolverStyle3D, SolverVBD, style3d

from benchmarks.engines.sheets import SPACING, STEP, Engine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.meshes import Mesh

SUBSTEPS = 4  # In `STEP`, an even number.
ITERATIONS = 10  # In a substep.
CONTACT_STIFFNESS, CONTACT_DAMPING = 2000.0, 20.0  # [N/m], [N s/m]: as ours between layers.


@wp.kernel
def lead(
    vertices: wp.array(dtype=wp.int32),
    starts: wp.array(dtype=wp.vec3),
    targets: wp.array(dtype=wp.vec3),
    share: float,
    step: float,
    q0: wp.array(dtype=wp.vec3),
    q1: wp.array(dtype=wp.vec3),
    v0: wp.array(dtype=wp.vec3),
):
    """Puts held vertices where they are at the end of a substep."""
    i = wp.tid()
    vertex = vertices[i]
    way = targets[i] - starts[i]
    place = starts[i] + way * share
    q0[vertex] = place
    q1[vertex] = place
    v0[vertex] = way / step


class NewtonSheet:
    """A sheet that one of Newton's solvers moves."""

    def __init__(self, model, solver, start: np.ndarray):
        self._model, self._solver = model, solver
        self._states = [model.state(), model.state()]
        self._control = model.control()
        self._pipeline = newton.CollisionPipeline(model)
        self._contacts = self._pipeline.contacts()
        for state in self._states:
            state.particle_q.assign(start.astype(np.float32))
        self._flags = model.particle_flags.numpy().copy()
        self._mass = model.particle_inv_mass.numpy().copy()
        self._held = np.zeros(0, int)

    def positions(self) -> np.ndarray:
        return self._states[0].particle_q.numpy().astype(float)

    def hold(self, vertices: np.ndarray) -> None:
        self._held = np.asarray(vertices, int)
        flags, mass = self._flags.copy(), self._mass.copy()
        flags[self._held] &= ~int(ParticleFlags.ACTIVE)
        mass[self._held] = 0.0
        self._model.particle_flags.assign(flags)
        self._model.particle_inv_mass.assign(mass)

    def step(self, targets: np.ndarray) -> None:
        start = self.positions()[self._held]
        number = len(self._held)
        if number:
            arrays = (
                wp.array(self._held.astype(np.int32), dtype=wp.int32),
                wp.array(start.astype(np.float32), dtype=wp.vec3),
                wp.array(targets.astype(np.float32), dtype=wp.vec3),
            )
        if hasattr(self._solver, "rebuild_bvh"):
            self._solver.rebuild_bvh(self._states[0])
        for part in range(1, SUBSTEPS + 1):
            before, after = self._states
            before.clear_forces()
            if number:
                outputs = (before.particle_q, after.particle_q, before.particle_qd)
                wp.launch(lead, number, [*arrays, part / SUBSTEPS, STEP, *outputs])
            self._pipeline.collide(before, self._contacts)
            self._solver.step(before, after, self._control, self._contacts, STEP / SUBSTEPS)
            self._states.reverse()

    def close(self) -> None:
        """Memory goes with the object."""


def build(
    add: Callable, solve: Callable,
    mesh: Mesh, fabric: Fabric, start: np.ndarray, gravity: np.ndarray, floor: bool,
) -> NewtonSheet:  # fmt: skip
    """A sheet that a solver moves.

    Args:
        add: adds a fabric's sheet to a builder, with what all ways to add a mesh are told.
        solve: makes the solver of a model and a fabric.
        mesh, fabric, start, gravity, floor: as of `sheets.Build`.
    """
    builder = newton.ModelBuilder()
    add(
        builder,
        fabric,
        pos=wp.vec3(0.0, 0.0, 0.0),
        rot=wp.quat_identity(),
        scale=1.0,
        vel=wp.vec3(0.0, 0.0, 0.0),
        vertices=mesh.points.tolist(),
        indices=mesh.triangles.ravel().tolist(),
        density=fabric.density,
        particle_radius=fabric.thickness / 2,
    )
    number = len(mesh.points)
    builder.particle_mass[:] = [fabric.density * mesh.area / number] * number
    if floor:
        shape = builder.default_shape_cfg.copy()
        shape.mu = fabric.friction
        builder.add_ground_plane(cfg=shape)
    builder.color(include_bending=True)
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd = CONTACT_STIFFNESS, CONTACT_DAMPING
    model.soft_contact_mu = fabric.friction
    model.set_gravity(tuple(gravity.tolist()))
    return NewtonSheet(model, solve(model, fabric), start)


def _add_vbd(builder, fabric: Fabric, **placed) -> None:
    builder.add_cloth_mesh(
        tri_ke=fabric.stretch_stiffness / 2,
        tri_ka=0.0,
        tri_kd=fabric.stretch_damping,
        edge_ke=fabric.bend_stiffness / SPACING,
        edge_kd=fabric.bend_damping,
        **placed,
    )


def _solve_vbd(model, fabric: Fabric) -> SolverVBD:
    return SolverVBD(
        model,
        iterations=ITERATIONS,
        particle_enable_self_contact=True,
        particle_self_contact_margin=fabric.thickness,
        particle_self_contact_gap=fabric.thickness / 2,
    )


def _add_style3d(builder, fabric: Fabric, **placed) -> None:
    SolverStyle3D.register_custom_attributes(builder)
    stretch, bend = fabric.stretch_stiffness, fabric.bend_stiffness
    style3d.add_cloth_mesh(
        builder,
        tri_aniso_ke=wp.vec3(stretch, stretch, stretch / 2),
        edge_aniso_ke=wp.vec3(bend, bend, bend),
        **placed,
    )


def _solve_style3d(model, fabric: Fabric) -> SolverStyle3D:
    return SolverStyle3D(model, config=SolverStyle3D.Config(iterations=ITERATIONS))


_SETTINGS = {
    "substeps": SUBSTEPS,
    "iterations": ITERATIONS,
    "contact_stiffness": CONTACT_STIFFNESS,
    "contact_damping": CONTACT_DAMPING,
}


def _engine(name: str, title: str, add: Callable, solve: Callable) -> Engine:
    return Engine(name, title, functools.partial(build, add, solve), _SETTINGS)


VBD = _engine("vbd", "Newton 1.8 VBD", _add_vbd, _solve_vbd)
STYLE3D = _engine("style3d", "Newton 1.8 Style3D", _add_style3d, _solve_style3d)
