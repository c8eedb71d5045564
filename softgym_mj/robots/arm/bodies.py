"""Bodies of arms in a scene, and the same arms alone for kinematics."""

import functools
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.entities.flex import GRIPPER_CONTACT
from softgym_mj.exceptions import check_name
from softgym_mj.robots.arm import menagerie
from softgym_mj.robots.arm.models import Arm
from softgym_mj.robots.arm.mounts import Mount

# [s] Damping over stiffness of the servos in a scene. With the models' 0.05, a servo at its torque
# limit flutters at steps of 10 ms, because its damping is then explicit.
DAMPING = 0.015
FLOOR = "floor"  # Geom of the kinematic model.
KEPT = 16  # Kinematic models in the cache; a model has some 30 kB.
CAMERA = "wrist"  # Camera on the hand of an arm's model; in a scene, with the arm's number.
PEDESTAL, PEDESTAL_COLOR = 0.11, (0.25, 0.26, 0.28, 1.0)  # Radius [m] and color: steel gray.


def names(arm: Arm, number: int) -> tuple[str, ...]:
    """Returns the names (number,) of the arms' models."""
    return tuple(f"{arm.name}_{i}" for i in range(number))


def wrists(number: int) -> tuple[str, ...]:
    """Returns the names (number,) of the cameras on the arms' hands."""
    return tuple(f"{CAMERA}_{i}" for i in range(number))


def home(arm: Arm) -> np.ndarray:
    """Returns joint angles (joints,) [rad] in which the fingers close across the arm's direction.

    Arms that face each other then turn the flat sides of their hands to each other.
    """
    angles = np.array(arm.home)
    angles[-1] -= math.copysign(math.pi / 2, angles[-1])
    return angles


def add_arms(
    root: mjcf.RootElement,
    arm: Arm,
    mounts: Sequence[Mount],
    pad_contact: Mapping[str, object] = MappingProxyType({}),
    least_pad: tuple[float, float] = (0.0, 0.0),
    visual: str = "primitive",
) -> None:
    """Adds an arm for each mount to a model; hands and fingers collide with objects.

    Cameras on the hands are named as in `wrists`.

    Args:
        root: the model.
        arm: kind of arm.
        mounts: bases of the arms.
        pad_contact: contact attributes of the pads' geoms.
        least_pad: least half width and half length [m] of the pads' geoms.
        visual: appearance: "primitive" for simple shapes, or "menagerie".

    Raises:
        InvalidArgumentError: for an unknown `visual`.
        UnavailableError: as in `menagerie.replace_visuals`.
    """
    check_name("visual", visual, menagerie.VISUALS)
    number = len(mounts)
    for name, camera, mount in zip(names(arm, number), wrists(number), mounts, strict=True):
        model = _load(arm, name)
        model.find("camera", CAMERA).name = camera
        for geom in hand_geoms(model, arm):
            geom.contype, geom.conaffinity, geom.condim, geom.priority = GRIPPER_CONTACT, 0, 3, 1
        for pad in arm.pad_geoms:
            model.find("geom", pad).set_attributes(**pad_contact)
            _enlarge(model.find("geom", pad), *least_pad)
        if visual == "menagerie":
            menagerie.replace_visuals(model, arm)
        _attach(root, model, mount)
        height = mount.base[2]
        if height > 0.0:
            root.worldbody.add(
                "geom", name=f"{name}_pedestal", type="cylinder", size=[PEDESTAL, height / 2],
                pos=[*mount.base[:2], height / 2], rgba=PEDESTAL_COLOR, contype=0, conaffinity=0,
            )  # fmt: skip


@functools.lru_cache(maxsize=KEPT)
def kinematic_model(arm: Arm, mounts: tuple[Mount, ...], tips: float = 0.0) -> mujoco.MjModel:
    """Returns a model of the arms alone, with open fingers, collision geoms and the floor.

    It is compiled once for all environments of a process: nobody may change it. The pads lack the
    last `tips` [m], which may come nearer to the floor than the rest.
    """
    root = mjcf.RootElement(model="kinematics")
    root.worldbody.add("geom", name=FLOOR, type="plane", size=[1.0, 1.0, 1.0])
    for name, mount in zip(names(arm, len(mounts)), mounts, strict=True):
        model = _load(arm, name)
        fingers = [model.find("joint", finger) for finger in arm.finger_joints]
        outer = model.find("joint", arm.wrist_joint).parent.find_all("geom")
        for geom in model.find_all("geom"):
            if geom not in outer or geom.dclass.dclass == "visual":
                geom.remove()
            else:
                geom.contype = geom.conaffinity = 1  # mink only keeps geoms apart that can collide.
        for pad in arm.pad_geoms:
            _shorten(model.find("geom", pad), tips)
        for kind in ("actuator", "equality"):
            for element in model.find_all(kind):
                element.remove()
        for finger in fingers:
            _open(finger, arm.finger_range[1])
        for element in [*fingers, *model.asset.mesh]:
            element.remove()
        _attach(root, model, mount)
    return mujoco.MjModel.from_xml_string(root.to_xml_string())


def outer_geoms(model: mujoco.MjModel, names: Sequence[str]) -> list[list[int]]:
    """Returns the geoms of each arm of a kinematic model."""
    owners = [model.geom(i).name.split("/")[0] for i in range(model.ngeom)]
    return [[i for i, owner in enumerate(owners) if owner == name] for name in names]


def hand_geoms(model: mjcf.RootElement, arm: Arm) -> list[mjcf.Element]:
    """Returns the solid geoms of a hand: the pads, then the hand itself."""
    pads = [model.find("geom", pad) for pad in arm.pad_geoms]
    hand = pads[0].parent.parent
    return [*pads, *(geom for geom in hand.geom if geom.dclass.dclass == "collision")]


def tune(
    model: mujoco.MjModel, motors: np.ndarray, inertias: np.ndarray, torques: np.ndarray
) -> np.ndarray:
    """Fits position servos to the physics step; returns their lag behind a moving command [s].

    The "discrete" integrator is implicit in a servo's stiffness and damping, but MuJoCo clips the
    force before the step. Over a step of h, an inertia I receives 1 + (kv h + kp h^2) / I times
    less of it. The force limits are widened by that factor, so that the motor's torque accelerates
    a joint.

    This is exact for joints that move freely, with their inertia at home. A joint that contact
    stops receives the widened limit: 1.4 to 2.7 times the motor's torque with steps of 10 ms and
    1.2 to 1.7 times with 5 ms.

    Args:
        model: compiled scene.
        motors: actuators (n,).
        inertias: inertias that they move (n,) [kg m^2].
        torques: their largest torques (n,) [N m].
    """
    step, stiffness = model.opt.timestep, model.actuator_gainprm[motors, 0]
    damping = DAMPING * stiffness
    model.actuator_biasprm[motors, 2] = -damping
    limits = torques * (1.0 + (damping * step + stiffness * step**2) / inertias)
    model.actuator_forcerange[motors] = np.column_stack([-limits, limits])
    joints = model.actuator_trnid[motors, 0]
    return (damping + model.dof_damping[model.jnt_dofadr[joints]]) / stiffness


def _load(arm: Arm, name: str) -> mjcf.RootElement:
    model = mjcf.from_path(arm.xml_path)
    model.model = name
    model.keyframe.remove()  # The keyframe fits this model only: a scene has more coordinates.
    return model


def _open(finger: mjcf.Element, position: float) -> None:
    """Moves the body of a slide to the slide's `position` [m]."""
    body, way = finger.parent, np.zeros(3)
    axis = finger.dclass.joint.axis if finger.axis is None else finger.axis
    quaternion = np.array([1.0, 0.0, 0.0, 0.0] if body.quat is None else body.quat)
    mujoco.mju_rotVecQuat(way, position * axis, quaternion)
    body.pos = body.pos + way


def _shorten(pad: mjcf.Element, length: float) -> None:
    """Removes `length` [m] from the far end of a pad."""
    shape, along = pad.dclass.geom, np.array([0.0, 0.0, length / 2])
    pad.size, pad.pos = shape.size - along, shape.pos - along


def _enlarge(pad: mjcf.Element, half_width: float, half_length: float) -> None:
    """Gives a pad a least width and length [m]; its tip and its closing face stay in place."""
    width, depth, length = pad.dclass.geom.size
    pad.size = [max(width, half_width), depth, max(length, half_length)]
    pad.pos = pad.dclass.geom.pos - np.array([0.0, 0.0, pad.size[2] - length])


def _attach(root: mjcf.RootElement, model: mjcf.RootElement, mount: Mount) -> None:
    frame = root.attach(model)
    frame.pos = mount.base
    frame.quat = [math.cos(mount.yaw / 2), 0.0, 0.0, math.sin(mount.yaw / 2)]
