"""Newton's solvers of cloth: VBD and Style3D, on a CPU."""

import dataclasses
from typing import Any

import newton
import numpy as np
import warp as wp
from newton import ParticleFlags
from newton.solvers import SolverStyle3D, SolverVBD, style3d

from benchmarks.engines.sheets import SPACING, STEP, Engine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.meshes import Mesh

CONTACT_STIFFNESS, CONTACT_DAMPING = 2000.0, 20.0  # [N/m], [N s/m]: as ours between layers.


@dataclasses.dataclass(frozen=True)
class Settings:
    """What decides how exactly equations are solved.

    Attributes:
        substeps: in `STEP`, an even number.
        iterations: in a substep.
    """

    substeps: int = 4
    iterations: int = 10


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

    def __init__(self, model, solver, start: np.ndarray, settings: Settings):
        self._model, self._solver, self._settings = model, solver, settings
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
        count = self._settings.substeps
        if hasattr(self._solver, "rebuild_bvh"):
            self._solver.rebuild_bvh(self._states[0])
        for part in range(1, count + 1):
            before, after = self._states
            before.clear_forces()
            if number:
                outputs = (before.particle_q, after.particle_q, before.particle_qd)
                wp.launch(lead, number, [*arrays, part / count, STEP, *outputs])
            self._pipeline.collide(before, self._contacts)
            self._solver.step(before, after, self._control, self._contacts, STEP / count)
            self._states.reverse()

    def close(self) -> None:
        """Memory goes with the object."""


def _finished(builder, mesh: Mesh, fabric: Fabric, gravity: np.ndarray, floor: bool):
    """The model of a builder that has a cloth."""
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
    return model


def _placed(mesh: Mesh) -> dict[str, Any]:
    """What all ways to add a mesh are told."""
    return {
        "pos": wp.vec3(0.0, 0.0, 0.0),
        "rot": wp.quat_identity(),
        "scale": 1.0,
        "vel": wp.vec3(0.0, 0.0, 0.0),
        "vertices": mesh.points.tolist(),
        "indices": mesh.triangles.ravel().tolist(),
    }


def build_vbd(
    mesh: Mesh,
    fabric: Fabric,
    start: np.ndarray,
    gravity: np.ndarray,
    floor: bool,
    settings: Settings = Settings(),  # Frozen.
) -> NewtonSheet:
    """A sheet that vertex block descent moves."""
    builder = newton.ModelBuilder()
    builder.add_cloth_mesh(
        **_placed(mesh),
        density=fabric.density,
        tri_ke=fabric.stretch_stiffness / 2,
        tri_ka=0.0,
        tri_kd=fabric.stretch_damping,
        edge_ke=fabric.bend_stiffness / SPACING,
        edge_kd=fabric.bend_damping,
        particle_radius=fabric.thickness / 2,
    )
    model = _finished(builder, mesh, fabric, gravity, floor)
    solver = SolverVBD(
        model,
        iterations=settings.iterations,
        particle_enable_self_contact=True,
        particle_self_contact_margin=fabric.thickness,
        particle_self_contact_gap=fabric.thickness / 2,
    )
    return NewtonSheet(model, solver, start, settings)


def build_style3d(
    mesh: Mesh,
    fabric: Fabric,
    start: np.ndarray,
    gravity: np.ndarray,
    floor: bool,
    settings: Settings = Settings(),  # Frozen.
) -> NewtonSheet:
    """A sheet that Style3D's projective solver moves."""
    builder = newton.ModelBuilder()
    SolverStyle3D.register_custom_attributes(builder)
    stretch, bend = fabric.stretch_stiffness, fabric.bend_stiffness
    style3d.add_cloth_mesh(
        builder,
        **_placed(mesh),
        density=fabric.density,
        tri_aniso_ke=wp.vec3(stretch, stretch, stretch / 2),
        edge_aniso_ke=wp.vec3(bend, bend, bend),
        particle_radius=fabric.thickness / 2,
    )
    model = _finished(builder, mesh, fabric, gravity, floor)
    config = SolverStyle3D.Config(iterations=settings.iterations)
    return NewtonSheet(model, SolverStyle3D(model, config=config), start, settings)


_SETTINGS = dataclasses.asdict(Settings()) | {
    "contact_stiffness": CONTACT_STIFFNESS,
    "contact_damping": CONTACT_DAMPING,
}
VBD = Engine("vbd", "Newton 1.8 VBD", build_vbd, _SETTINGS)
STYLE3D = Engine("style3d", "Newton 1.8 Style3D", build_style3d, _SETTINGS)
