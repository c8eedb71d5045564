"""`Specimen`: a sheet in plain MuJoCo with clamped vertices."""

from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.flex import HELD_MASS
from softgym_mj.entities.mesh_files import triangle_areas
from softgym_mj.exceptions import SimulationError
from softgym_mj.native.library import CLOTH, load_plugin
from softgym_mj.reality.lab.theory import GRAVITY
from softgym_mj.reality.lab.vertices import Vertices

_STILL = 1e-4  # Convergence: change relative to the total change so far.
_ROUNDING = 1e-8  # [m] Convergence: absolute change, due to rounding.
_PEAKS = 3  # Number of stops of the motion between which the change is measured.
_MOST_STEPS = 30_000


class Specimen(Vertices):
    """Sheet of a fabric, with the parameters of the entities, with or without a floor.

    Attributes:
        start: initial vertices (n, 3) [m].
        triangles: (m, 3).
        held: indices of the clamped vertices.
        steps: number of steps so far.
    """

    def __init__(
        self,
        points: np.ndarray,
        triangles: np.ndarray,
        fabric: Fabric,
        *,
        gravity: Sequence[float] = (0.0, 0.0, -GRAVITY),
        floor: bool = False,
        substeps: int = 25,
        timestep: float = solver.TIMESTEP,
    ):
        """Builds the model.

        Args:
            points: vertices (n, 3) [m], flat; with a floor, half of the fabric's thickness high.
            triangles: (m, 3).
            fabric: the fabric.
            gravity: [m/s^2]
            floor: whether there is a floor at z = 0.
            substeps: substeps of a step.
            timestep: [s]
        """
        load_plugin()
        xml = _xml(points, triangles, fabric, gravity, floor, substeps, timestep)
        model = mujoco.MjModel.from_xml_string(xml)
        solver.forget_damping(model)
        super().__init__(model, mujoco.MjData(model))
        self.triangles = np.asarray(triangles)
        self.start, self.held, self.steps = self.positions(), np.zeros(0, int), 0

    def weigh_by_area(self) -> None:
        """Sets masses of vertices to those of their Voronoi areas, so that the weight is uniform.

        By default MuJoCo gives all vertices of a flex the same mass, twice their share at the rim.
        """
        corners = self.start[self.triangles]
        sides = corners[:, [2, 0, 1]] - corners  # Edges from each corner, and
        other = corners[:, [1, 2, 0]] - corners
        dots = (sides * other).sum(axis=2)
        doubled = np.linalg.norm(np.cross(sides[:, 0], other[:, 0]), axis=1)[:, None]
        # Area of each corner: a quarter of the squared sides that meet there times the cotangents
        # of the opposite angles (Voronoi areas).
        cotangents = dots / doubled
        squares = (other**2).sum(axis=2)  # Squared edges from each corner to the next.
        shares = (
            squares * cotangents[:, [2, 0, 1]]
            + np.roll(squares, 1, axis=1) * cotangents[:, [1, 2, 0]]
        ) / 8.0
        area = np.zeros(len(self.start))
        np.add.at(area, self.triangles.ravel(), shares.ravel())
        bodies = self.model.flex_vertbodyid
        self.model.body_mass[bodies] = self.model.body_mass[bodies].sum() * area / area.sum()
        mujoco.mj_setConst(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)

    def hold(self, vertices: np.ndarray) -> None:
        """Clamps vertices (k,) at their positions."""
        self.held = np.asarray(vertices)
        self.model.dof_M0[self.dofs[self.held]] = HELD_MASS

    def step(self, count: int = 1) -> None:
        """Simulates steps; clamped vertices stay."""
        for _ in range(count):
            self.data.qvel[self.dofs[self.held]] = 0.0
            mujoco.mj_step(self.model, self.data)
        self.steps += count

    def settle(self) -> None:
        """Simulates until it hangs still.

        The motion is stopped whenever its kinetic energy peaks (Cundall's kinetic damping of
        dynamic relaxation).

        Raises:
            SimulationError: if it does not come to rest.
        """
        before, last, heights = self.positions(), 0.0, []
        for _ in range(_MOST_STEPS):
            self.step()
            energy = float((self.velocities() ** 2).sum())
            if energy >= last:
                last = energy
                continue
            self.data.qvel[self.dofs] = 0.0
            last = 0.0
            heights.append(self.positions())
            if len(heights) > _PEAKS:
                change = np.abs(heights[-1] - heights[-1 - _PEAKS]).max()
                if change <= max(_STILL * np.abs(heights[-1] - before).max(), _ROUNDING):
                    return
        raise SimulationError(f"a sheet of {len(self.start)} vertices does not come to rest")


def _xml(points, triangles, fabric, gravity, floor, substeps, timestep) -> str:
    config = "".join(
        f'<config key="{key}" value="{value!r}"/>'
        for key, value in {**fabric.material(), "substeps": substeps}.items()
        if value != 0.0
    )
    mass = fabric.density * float(triangle_areas(points, triangles).sum())
    numbers = " ".join(f"{x:.12g}" for x in points.ravel())
    elements = " ".join(map(str, triangles.ravel()))
    plane = '<geom type="plane" size="9 9 .1" friction="1e-3"/>' if floor else ""
    return f"""<mujoco>
    <option timestep="{timestep!r}" gravity="{" ".join(map(str, gravity))}" integrator="Euler"/>
    <size memory="64M"/>
    <extension><plugin plugin="{CLOTH}"><instance name="fabric">{config}</instance></plugin>
    </extension>
    <worldbody>{plane}
      <flexcomp name="sheet" type="direct" dim="2" mass="{mass!r}"
        radius="{fabric.thickness / 2.0!r}" point="{numbers}" element="{elements}">
        <contact selfcollide="none" contype="0" conaffinity="0" friction="{fabric.friction!r}"/>
        <edge equality="false" damping="1e-12"/>
        <plugin plugin="{CLOTH}" instance="fabric"/>
      </flexcomp>
    </worldbody></mujoco>"""
