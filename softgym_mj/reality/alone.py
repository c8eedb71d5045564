"""A cable or a sheet alone in the air, with masses of vertices of our choice."""

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth import fabrics, solver
from softgym_mj.entities.flex import Flex


def compiled_alone(flex: Flex) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compiles a flex under gravity, and nothing else."""
    root = mjcf.RootElement(model="recording")
    root.option.gravity = [0.0, 0.0, -fabrics.GRAVITY]
    for part in (root, flex.mjcf_model):
        part.option.timestep = solver.TIMESTEP
    root.attach(flex.mjcf_model)
    physics = mjcf.Physics.from_mjcf_model(root)
    flex.after_compile(physics, None)
    return physics.model.ptr, physics.data.ptr


def set_masses(flex: Flex, model: mujoco.MjModel, data: mujoco.MjData, masses: np.ndarray) -> None:
    """Sets the masses (n,) [kg] of the vertices, which are equal by default; resets `data.qpos`."""
    bodies = model.flex_vertbodyid[flex.vertex_ids]
    scale = masses / model.body_mass[bodies]
    model.body_mass[bodies] *= scale
    model.body_inertia[bodies] *= scale[:, None]
    mujoco.mj_setConst(model, data)
