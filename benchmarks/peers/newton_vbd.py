"""Newton: cloth by vertex block descent (SolverVBD), with the settings of Newton's cloth examples.

Substeps of 1/600 s with a collision pass in each (cloth_hanging, cloth_bending), 10 iterations (the
default; cloth_twist has 4), contact stiffness 1e3 and damping 0.1, contact buffers and one rebuild
of the bounding volume hierarchies per step (cloth_twist), and a detection gap of half the margin
(documentation of SolverVBD). The membrane is isotropic with Poisson's ratio 0.
"""

from typing import Any

import newton
import numpy as np
import warp as wp

from benchmarks.peers.scene import STEP, Scene
from benchmarks.peers.warp_steps import WarpSteps

SUBSTEPS = 6  # Even: a CUDA graph swaps both states back.
CONTACT_STIFFNESS, CONTACT_DAMPING = 1e3, 1e-1
# Contacts of elements with a common vertex are left out (cloth_franka). With the default, 2, Newton
# builds lists in Python for minutes; farther elements of this flat mesh are beyond the margin.
FILTER_RINGS = 1
VERTEX_CONTACTS, EDGE_CONTACTS = 64, 128  # Room for contacts of a vertex, and of an edge.


def model_of(scene: Scene, num_envs: int) -> newton.Model:
    """Returns a model with a world per environment, in which a cloth hangs vertically."""
    fabric, cloth, builder = scene.fabric, newton.ModelBuilder(), newton.ModelBuilder()
    # At Poisson's ratio 0, half the stretch stiffness is the first Lame parameter. A hinge has the
    # stiffness of the cells on both its sides.
    stretch, bend = fabric.stretch_stiffness / 2.0, fabric.bend_stiffness / scene.spacing
    cloth.add_cloth_mesh(
        pos=wp.vec3(),
        rot=wp.quat_identity(),
        vel=wp.vec3(),
        scale=1.0,
        vertices=[wp.vec3(*point) for point in scene.points()],
        indices=scene.triangles.ravel().tolist(),
        density=fabric.density,
        tri_ke=stretch,
        tri_ka=0.0,
        tri_kd=stretch * fabric.stretch_damping,
        edge_ke=bend,
        edge_kd=bend * fabric.bend_damping,
        particle_radius=fabric.thickness / 2.0,
    )
    cloth.color(include_bending=True)
    floor = builder.default_shape_cfg
    floor.ke, floor.kd, floor.mu = CONTACT_STIFFNESS, CONTACT_DAMPING, fabric.friction
    builder.add_ground_plane()
    builder.replicate(cloth, num_envs)
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd = CONTACT_STIFFNESS, CONTACT_DAMPING
    model.soft_contact_mu = fabric.layer_friction
    return model


class NewtonVbd(WarpSteps):
    """A `Simulation` by Newton: a world per environment."""

    substeps = SUBSTEPS

    def __init__(self, scene: Scene, num_envs: int, device: str, iterations: int = 10):
        """Builds the model and captures a step; `device` is "cpu" or "cuda"."""
        wp.set_device(device)
        self._count, margin = scene.num_points, scene.fabric.thickness
        self._model = model = model_of(scene, num_envs)
        self.settings: dict[str, Any] = {
            "newton": newton.__version__,
            "warp": wp.__version__,
            "precision": "float32",
            "iterations": iterations,
        }
        self._pipeline = newton.CollisionPipeline(model)
        self._contacts = self._pipeline.contacts()
        self._solver = newton.solvers.SolverVBD(
            model,
            iterations=iterations,
            particle_enable_self_contact=True,
            particle_self_contact_margin=margin,
            particle_self_contact_gap=margin / 2.0,
            particle_topological_contact_filter_threshold=FILTER_RINGS,
            particle_vertex_contact_buffer_size=VERTEX_CONTACTS,
            particle_edge_contact_buffer_size=EDGE_CONTACTS,
        )
        self._states, self._control = (model.state(), model.state()), model.control()
        self._start = wp.array(scene.starts(num_envs).reshape(-1, 3), dtype=wp.vec3)
        flags = model.particle_flags.numpy()
        self._free = wp.array(flags, dtype=wp.int32)
        corners = np.arange(num_envs)[:, None] * scene.num_points + np.array(scene.held)
        flags[corners] &= ~int(newton.ParticleFlags.ACTIVE)
        self._fixed = wp.array(flags, dtype=wp.int32)
        self.capture()

    def _steps(self) -> None:
        first, second = self._states
        self._solver.rebuild_bvh(first)
        for _ in range(SUBSTEPS):
            first.clear_forces()
            self._pipeline.collide(first, self._contacts)
            self._solver.step(first, second, self._control, self._contacts, STEP / SUBSTEPS)
            first, second = second, first

    def restart(self) -> None:
        for state in self._states:
            wp.copy(state.particle_q, self._start)
            state.particle_qd.zero_()
        wp.copy(self._model.particle_flags, self._fixed)

    def release(self) -> None:
        wp.copy(self._model.particle_flags, self._free)

    def positions(self, number: int) -> np.ndarray:
        points = self._states[0].particle_q[: number * self._count].numpy().astype(float)
        return points.reshape(number, self._count, 3)

    def problems(self) -> list[str]:
        flags = self._solver.trimesh_collision_detector.resize_flags.numpy()
        names = "vertex contacts", "triangle contacts", "edge contacts"
        return [f"no room for all {name}" for name, flag in zip(names, flags, strict=False) if flag]
