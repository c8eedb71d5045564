"""MuJoCo's own flex: a shell of finite elements, implicit."""

import math

import mujoco
import numpy as np

from benchmarks.engines.mujoco_sheet import MujocoSheet
from benchmarks.engines.sheets import Engine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.meshes import Mesh

POISSON = 0.2
TIMESTEP = 0.005  # [s]
DAMPING = 1e-3  # [s] As ours along edges.
ITERATIONS, TOLERANCE = 50, 1e-6
# [s], damping ratio: twice as fast as MuJoCo's default, which is as fast as the step allows.
SOLREF = (0.01, 1.0)


def shell(stretch: float, bend: float) -> tuple[float, float]:
    """Young's modulus [Pa] and thickness [m] of a plate with both stiffnesses.

    E t = stretch, E t^3 / (12 (1 - nu^2)) = bend.

    Args:
        stretch: force per width and strain [N/m].
        bend: moment per width and curvature [N m].
    """
    thickness = math.sqrt(12.0 * (1.0 - POISSON**2) * bend / stretch)
    return stretch / thickness, thickness


def build(
    mesh: Mesh, fabric: Fabric, start: np.ndarray, gravity: np.ndarray, floor: bool
) -> MujocoSheet:
    """A sheet that MuJoCo moves."""
    young, thickness = shell(fabric.stretch_stiffness, fabric.bend_stiffness)
    points = " ".join(f"{x:.12g}" for x in mesh.points.ravel())
    elements = " ".join(map(str, mesh.triangles.ravel()))
    # The larger of two frictions counts.
    plane = '<geom type="plane" size="9 9 .1" friction="1e-3"/>' if floor else ""
    xml = f"""<mujoco>
    <option timestep="{TIMESTEP}" gravity="{" ".join(map(str, gravity.tolist()))}"
      integrator="discrete" solver="CG" iterations="{ITERATIONS}" tolerance="{TOLERANCE}"
      jacobian="sparse" cone="elliptic"/>
    <size memory="64M"/>
    <worldbody>{plane}
      <flexcomp name="sheet" type="direct" dim="2" mass="{fabric.density * mesh.area!r}"
        radius="{fabric.thickness / 2!r}" point="{points}" element="{elements}">
        <elasticity young="{young!r}" poisson="{POISSON}" thickness="{thickness!r}"
          damping="{DAMPING}" elastic2d="both"/>
        <contact selfcollide="auto" condim="3" friction="{fabric.friction!r}"
          solref="{SOLREF[0]} {SOLREF[1]}"/>
      </flexcomp>
    </worldbody></mujoco>"""
    return MujocoSheet(mujoco.MjModel.from_xml_string(xml), start)


ENGINE = Engine(
    "mujoco",
    "MuJoCo 3.17 flex",
    build,
    {
        "poisson": POISSON,
        "timestep": TIMESTEP,
        "damping": DAMPING,
        "iterations": ITERATIONS,
        "tolerance": TOLERANCE,
        "solref": SOLREF,
    },
)
