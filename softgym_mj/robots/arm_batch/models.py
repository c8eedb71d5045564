"""Models of one arm at the origin, from which those of batches are made."""

import functools

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.entities.flex import GRIPPER_CONTACT
from softgym_mj.robots.arm import bodies
from softgym_mj.robots.arm.grasps import GRASPS
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount


def at_origin(arm: Arm) -> Mount:
    """Returns a mount at the origin that faces +X."""
    return Mount((0.0, 0.0, 0.0), 0.0, *arm.reach)


@functools.lru_cache(maxsize=bodies.KEPT)
def dynamic_model(arm: Arm, timestep: float) -> tuple[mujoco.MjModel, np.ndarray]:
    """Returns the model of an arm with its servos, and their lags (joints,) [s].

    It has no geoms and no gravity, which arms compensate. It is cached: callers must not change it.
    """
    root = _root(arm)
    for kind in ("geom", "mesh", "camera"):
        for element in root.find_all(kind):
            element.remove()
    root.option.set_attributes(integrator="discrete", timestep=timestep, gravity=[0.0, 0.0, 0.0])
    model = mujoco.MjModel.from_xml_string(root.to_xml_string())
    (name,) = bodies.names(arm, 1)
    names = [f"{name}/{joint}" for joint in arm.joints]
    motors = np.array([model.actuator(motor).id for motor in names])
    joints = np.array([model.joint(joint).id for joint in names])
    data = mujoco.MjData(model)
    data.qpos[joints] = bodies.home(arm)
    mujoco.mj_forward(model, data)
    inertias = data.M[model.M_rowadr[joints] + model.M_rownnz[joints] - 1]
    return model, bodies.tune(model, motors, inertias, np.array(arm.torque_limits))


@functools.lru_cache(maxsize=bodies.KEPT)
def solid_model(arm: Arm, grasp: str) -> tuple[mujoco.MjModel, list[int]]:
    """Returns the model of an arm with its geoms, and the ids of those that push, ascending.

    Its bodies are those of `dynamic_model`; pads are those of a grasp of `GRASPS`. It is
    cached: callers must not change it.
    """
    root = _root(arm, GRASPS[grasp].least_pad)
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), assets=root.get_assets())
    return model, np.flatnonzero(model.geom_contype == GRIPPER_CONTACT).tolist()


def _root(arm: Arm, least_pad: tuple[float, float] = (0.0, 0.0)) -> mjcf.RootElement:
    root = mjcf.RootElement(model="arms")
    bodies.add_arms(root, arm, [at_origin(arm)], least_pad=least_pad)
    return root
