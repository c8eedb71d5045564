"""Ours: the engine plugin softgym_mj.cloth, in plain MuJoCo."""

import functools

import numpy as np

from benchmarks.engines.mujoco_sheet import MujocoSheet
from benchmarks.engines.sheets import STEP, Engine
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.lab.specimen import Specimen
from softgym_mj.reality.meshes import Mesh


def build(
    mesh: Mesh,
    fabric: Fabric,
    start: np.ndarray,
    gravity: np.ndarray,
    floor: bool,
    timestep: float = STEP,
) -> MujocoSheet:
    """A sheet that the plugin moves, in 25 substeps of a step of `timestep` [s]."""
    specimen = Specimen(
        mesh.points, mesh.triangles, fabric,
        gravity=gravity.tolist(), floor=floor, timestep=timestep,
    )  # fmt: skip
    return MujocoSheet(specimen.model, start)


def engine(timestep: float = STEP) -> Engine:
    """Ours with another step [s]."""
    made = functools.partial(build, timestep=timestep)
    return Engine("ours", "softgym_mj", made, {"timestep": timestep, "substeps": 25})
