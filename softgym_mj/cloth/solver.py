"""The engine plugin softgym_mj.cloth in a model: what a flex is made of.

It is the elasticity, bending, damping and friction of flexes and all that they touch, in one solve
of 25 substeps a step; MuJoCo moves everything else. See plugin/README.md.
"""

import ctypes
import dataclasses
import functools

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.exceptions import UnavailableError
from softgym_mj.native.library import CLOTH, load_plugin, open_library

TIMESTEP = 0.01  # [s]: a sim step. Of which the plugin makes 25.

_INSTANCE = "cloth"  # Name of an instance in the model of its flex.


@dataclasses.dataclass(frozen=True)
class Material:
    """What a flex is made of; of a rope, forces and moments are not per metre of width.

    Attributes:
        stretch: force per width and strain [N/m]; of a rope [N].
        shear: stiffness of a mesh's diagonals as a share of that of its other edges.
        bend: moment per width and curvature [N m]; of a rope [N m^2].
        bend_weft: if above 0, a sheet is a plate, with `bend` along its rest shape's X, this across
            it and `bend_bias` between them, or if that is 0 the mean of both [N m].
        stretch_damping, bend_damping: dashpots as a multiple of the stiffness [s].
        friction: between layers.
        drag: coefficient of the air's drag on what moves along its normal.
        added_mass: air that a surface takes along when it moves along its normal [kg/m^2].
        contype, conaffinity: what geoms it touches, as MuJoCo's attributes of this name.
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


# What models say only if it is not 0: as those that were made before these were known.
_OPTIONAL = ("bend_weft", "bend_bias")


def add_instance(root: mjcf.RootElement) -> mjcf.Element:
    """An instance of the plugin in a flex's own model; `set_material` completes it."""
    load_plugin()
    instance = root.extension.add("plugin", plugin=CLOTH).add("instance", name=_INSTANCE)
    for field in dataclasses.fields(Material):
        if field.name not in _OPTIONAL:
            instance.add("config", key=field.name)
    return instance


@functools.cache
def _check_knows_plates() -> None:
    """Raises `UnavailableError` if the plugin was built before sheets could be plates."""
    load_plugin()
    config = f'<config key="{_OPTIONAL[0]}" value="0"/>'
    instance = f'<plugin plugin="{CLOTH}"><instance name="a">{config}</instance></plugin>'
    try:
        mujoco.MjModel.from_xml_string(f"<mujoco><extension>{instance}</extension></mujoco>")
    except ValueError as error:  # In any case: no flex carries it.
        if "unrecognized" in str(error):
            raise UnavailableError(
                f"the engine plugins are older than this package and do not know {_OPTIONAL[0]!r}: "
                "build them again, with `make native` or as they were built."
            ) from error


def set_material(instance: mjcf.Element, material: Material) -> None:
    """Says what the flex of an instance is made of.

    Raises:
        UnavailableError: if it is a plate, and the plugin is too old to know of these.
    """
    for config in list(instance.config):
        if config.key in _OPTIONAL:
            config.remove()
    for name in _OPTIONAL:
        if getattr(material, name) > 0.0:
            _check_knows_plates()
            instance.add("config", key=name)
    for config in instance.config:
        config.value = repr(getattr(material, config.key))


def leave_to_plugin(flexcomp: mjcf.Element, instance: mjcf.Element) -> None:
    """Makes an instance of the plugin move a flexcomp, and MuJoCo keep its hands off it."""
    flexcomp.edge.equality = "false"
    # The compiler warns of a flex without any force of MuJoCo's: see `forget_damping`.
    flexcomp.edge.damping = 1e-12
    flexcomp.contact.selfcollide = "none"
    flexcomp.contact.contype = flexcomp.contact.conaffinity = 0
    flexcomp.add("plugin", plugin=CLOTH, instance=instance)


def forget_damping(model: mujoco.MjModel) -> None:
    """Takes away what `leave_to_plugin` had to say to the compiler: it costs a fifth of a step."""
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
    """The contacts (n,) of geoms with flexes in the last step, an array of `CONTACT`.

    geom is one of the model's, vertex are three of its flex vertices, -1 for none, with weights
    that give the point; normal is the direction from the geom to the flex, force what the flex felt
    [N], mean of the step, pressure its part along the normal.
    """
    found = np.empty(_MOST_CONTACTS, CONTACT)
    count = _library().softgym_mj_cloth_contacts(
        model._address, data._address, found.ctypes.data, len(found)
    )
    return found[: min(count, len(found))]


def holding_force(model: mujoco.MjModel, data: mujoco.MjData, vertex: int) -> float:
    """Force [N], mean of the last step, with which its edges pulled a held flex vertex.

    `vertex` is one of the model's. It is part of the state: a restored mjData knows it.
    """
    return _library().softgym_mj_cloth_holding_force(model._address, data._address, vertex)
