"""Static solids of a scene, such as a bar: geoms on bodies without joints that a flex may touch."""

import mujoco
import numpy as np

from softgym_mj.entities.flex import GRIPPER_CONTACT, OBJECT_CONTACT


def find(model: mujoco.MjModel) -> list[int]:
    """Returns the ids of static solids, ascending; planes are none."""
    touched = model.geom_contype & (OBJECT_CONTACT | GRIPPER_CONTACT) != 0
    touched |= model.geom_conaffinity & OBJECT_CONTACT != 0
    is_plane = model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)
    is_static = model.body_treeid[model.geom_bodyid] < 0
    return np.flatnonzero(touched & is_static & ~is_plane).tolist()


def poses(model: mujoco.MjModel, data: mujoco.MjData, solids: list[int]) -> np.ndarray:
    """Returns positions [m] and quaternions (w, x, y, z) of solids: (n, 7)."""
    found = np.zeros((len(solids), 7))
    for pose, geom in zip(found, solids, strict=True):
        pose[:3] = data.geom_xpos[geom]
        mujoco.mju_mulQuat(pose[3:], data.xquat[model.geom_bodyid[geom]], model.geom_quat[geom])
    return found
