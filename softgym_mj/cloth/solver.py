"""Adds the engine plugin softgym_mj.cloth to models and sets the material of flexes.

The plugin computes elasticity, bending, damping, contact and friction of flexes in one solver with
25 substeps per step; MuJoCo moves everything else (plugin/README.md).
"""

import ctypes
import dataclasses
import functools

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.native.library import CLOTH, load_plugin, open_library

TIMESTEP = 0.01  # [s] A sim step, which the plugin divides into 25 substeps.

_INSTANCE = "cloth"  # Name of an instance in the model of its flex.


@dataclasses.dataclass(frozen=True)
class Material:
    """Material of a flex; forces and moments of a rope are not per width.

    Attributes:
        stretch: Force per width and strain [N/m]; of a rope force per strain [N].
        stiffening: Relative growth of the stretch stiffness of a sheet per strain in tension,
            except of its diagonals.
        shear: Stiffness of a mesh's diagonals relative to its other edges.
        bend: Moment per width and curvature [N m]; of a rope [N m^2].
        bend_weft: If above 0, a sheet bends as an orthotropic plate: `bend` along its rest shape's
            X, `bend_weft` across it, and `bend_bias`, or if 0 their mean, between them [N m].
        twist: If above 0, a rope twists: moment per twist [N m^2].
        twist_clamped: Whether the frames of a twisting rope's ends are held even while its end
            vertices are not.
        stretch_damping, bend_damping: Dashpots as a multiple of the stiffness [s].
        friction: Friction coefficient between layers.
        drag: Coefficient of air drag for motion along the normal.
        added_mass: Mass of air moved along with the surface [kg/m^2].
        contype, conaffinity: Geoms that it touches, as MuJoCo's attributes of this name.
    """

    stretch: float
    bend: float
    shear: float = 1.0
    stretch_damping: float = 0.0
    bend_damping: float = 0.0
    friction: float = 0.0
    drag: float = 0.0
    added_mass: float = 0.0
    contype: int = 1
    conaffinity: int = 1
    bend_weft: float = 0.0
    bend_bias: float = 0.0
    twist: float = 0.0
    twist_clamped: int = 0
    stiffening: float = 0.0


# Attributes that are written only if not 0, so that models load with older builds of the plugin.
_OPTIONAL = ("bend_weft", "bend_bias", "twist", "twist_clamped", "stiffening")


def add_instance(root: mjcf.RootElement) -> mjcf.Element:
    """Adds an instance of the plugin to a flex's own model; `set_material` configures it."""
    load_plugin()
    instance = root.extension.add("plugin", plugin=CLOTH).add("instance", name=_INSTANCE)
    for field in dataclasses.fields(Material):
        if field.name not in _OPTIONAL:
            instance.add("config", key=field.name)
    return instance


@functools.cache
def _check_supported(attribute: str) -> None:
    """Raises `UnavailableError` if the built plugin does not have an optional attribute."""
    load_plugin()
    config = f'<config key="{attribute}" value="0"/>'
    instance = f'<plugin plugin="{CLOTH}"><instance name="a">{config}</instance></plugin>'
    try:
        mujoco.MjModel.from_xml_string(f"<mujoco><extension>{instance}</extension></mujoco>")
    except ValueError as error:  # In any case: no flex carries it.
        if "unrecognized" in str(error):
            raise UnavailableError(
                f"the engine plugins are older than this package and lack {attribute!r}: "
                "build them again, with `make native` or as they were built."
            ) from error


def set_material(instance: mjcf.Element, material: Material) -> None:
    """Sets the material of an instance's flex.

    Raises:
        UnavailableError: If it is a plate, stiffens or twists, which the built plugin lacks.
    """
    for config in list(instance.config):
        if config.key in _OPTIONAL:
            config.remove()
    for name in _OPTIONAL:
        if getattr(material, name) > 0.0:
            _check_supported(name)
            instance.add("config", key=name)
    for config in instance.config:
        config.value = repr(getattr(material, config.key))


def leave_to_plugin(flexcomp: mjcf.Element, instance: mjcf.Element) -> None:
    """Assigns a flexcomp to an instance of the plugin and disables MuJoCo's own flex forces."""
    flexcomp.edge.equality = "false"
    # The compiler warns of a flex without forces of MuJoCo; `forget_damping` removes this one.
    flexcomp.edge.damping = 1e-12
    flexcomp.contact.selfcollide = "none"
    flexcomp.contact.contype = flexcomp.contact.conaffinity = 0
    flexcomp.add("plugin", plugin=CLOTH, instance=instance)


def forget_damping(model: mujoco.MjModel) -> None:
    """Removes the damping that `leave_to_plugin` set for the compiler: it costs 20 % of a step."""
    model.flex_edgedamping[:] = 0.0


# A `Contact` of plugin/solids.h.
CONTACT = np.dtype(
    [
        ("geom", np.int32),
        ("vertex", np.int32, 3),
        ("weight", np.float64, 3),
        ("normal", np.float64, 3),
        ("force", np.float64, 3),
        ("pressure", np.float64),
    ],
    align=True,
)
_MOST_CONTACTS = 4096


@functools.cache
def _library() -> ctypes.CDLL:
    library = open_library()
    pointer = ctypes.c_void_p
    library.softgym_mj_cloth_contacts.argtypes = [pointer, pointer, pointer, ctypes.c_int]
    library.softgym_mj_cloth_holding_force.argtypes = [pointer, pointer, ctypes.c_int]
    library.softgym_mj_cloth_holding_force.restype = ctypes.c_double
    return library


def contacts(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Returns contacts (n,) between geoms and flexes in the last step, an array of `CONTACT`.

    geom is the geom's id; vertex are up to three flex vertices (-1 for none) with the weights of
    the contact point; normal points from the geom to the flex; force is the mean force on the flex
    [N], pressure its normal component [N].
    """
    found = np.empty(_MOST_CONTACTS, CONTACT)
    count = _library().softgym_mj_cloth_contacts(
        model._address, data._address, found.ctypes.data, len(found)
    )
    return found[: min(count, len(found))]


def holding_force(model: mujoco.MjModel, data: mujoco.MjData, vertex: int) -> float:
    """Returns the force [N] of its edges on a held flex vertex, mean of the last step.

    `vertex` is an index of the model. The force is part of the plugin state in mjData.
    """
    return _library().softgym_mj_cloth_holding_force(model._address, data._address, vertex)


def twist_angle(model: mujoco.MjModel, data: mujoco.MjData, flex: int) -> np.ndarray:
    """Returns the twist angle (1,) [rad] of a flex, a view of the plugin state in mjData.

    It is the right-handed roll of the last edge's frame relative to that of the first edge, carried
    along the rope by parallel transport. Writing it turns the ends.

    Raises:
        InvalidArgumentError: If the flex does not twist.
        UnavailableError: If the built plugin does not support twist.
    """
    _check_supported("twist")
    find = _library().softgym_mj_cloth_twist
    find.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
    find.restype = ctypes.POINTER(ctypes.c_double)
    address = find(model._address, data._address, flex)
    if not address:
        raise InvalidArgumentError("flex", flex, "a rope with a `twist` above 0")
    return np.ctypeslib.as_array(address, (1,))
