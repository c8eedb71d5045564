"""Rigid objects of a scene: solids for rays, and meshes."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.batch.layout import SOLID
from softgym_mj.rendering.batch.materials import material_of
from softgym_mj.rendering.batch.rigid import Rigid, box, flat, mesh_of
from softgym_mj.rendering.observables import LABELS, geom_labels
from softgym_mj.rendering.offscreen import SHOWN_SITES

_BOX, _SPHERE, _CYLINDER = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in ("BOX", "SPHERE", "CYLINDER")
)
_SHAPES = (_BOX, _SPHERE, _CYLINDER)  # The same order as in scene.h.
_DRAWN = "boxes, spheres, cylinders, capsules and meshes without textures"
_MOST_SOLIDS = 32  # Number of bits in a visibility mask.
_SHOWN = 3  # Groups of geoms below this number are rendered.


def solids_of(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    movers: Mapping[int, int],
    parts: Mapping[str, Sequence[str]],
    textures: list[np.ndarray],
) -> tuple[np.ndarray, list[Rigid], list[Rigid]]:
    """Returns solids for rays, opaque meshes and meshes of glass.

    The actor's shapes are meshes if all shapes are too many for rays, as with arms.

    Raises:
        InvalidArgumentError: If there are other shapes or too many solids.
    """
    labels, shown = geom_labels(model, parts), np.flatnonzero(model.geom_group < _SHOWN)
    is_solid = np.isin(model.geom_type, _SHAPES)
    if is_solid[shown].sum() > _MOST_SOLIDS:
        is_solid &= labels != LABELS.index("actor")
    solids: list[tuple] = []
    opaque: list[Rigid] = []
    glasses: list[Rigid] = []
    for geom in shown.tolist():
        pose = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        mover, (position, rotation) = on_mover(model, data, movers, model.geom_bodyid[geom], pose)
        material = material_of(model, model.geom_matid[geom], model.geom_rgba[geom], textures)
        if is_solid[geom]:
            shape = _SHAPES.index(int(model.geom_type[geom]))
            solids.append(
                (shape, mover, labels[geom], model.geom_size[geom], position, rotation, material)
            )
            continue
        mesh = mesh_of(model, geom)
        if mesh is None or material["texture"] >= 0:
            name = mujoco.mjtGeom(model.geom_type[geom]).name
            raise InvalidArgumentError("geom", f"{model.geom(geom).name}, {name}", _DRAWN)
        rigid = Rigid(mover, int(labels[geom]), mesh.moved(rotation, position), material)
        (glasses if material["opacity"] < 1.0 else opaque).append(rigid)
    if len(solids) > _MOST_SOLIDS:
        raise InvalidArgumentError("geoms", len(solids), f"at most {_MOST_SOLIDS} to draw")
    return np.array([flat(solid) for solid in solids], SOLID), opaque, glasses


def on_mover(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    movers: Mapping[int, int],
    body: int,
    pose: tuple[np.ndarray, np.ndarray],
) -> tuple[int, tuple[np.ndarray, np.ndarray]]:
    """Returns the mover of a body, or -1, and a pose relative to it instead of the world.

    Args:
        model, data: Scene.
        movers: Mover index by body.
        body: The body.
        pose: Position (3,) [m] and rotation (3, 3).
    """
    while body and body not in movers:
        body = int(model.body_parentid[body])
    mover, (position, rotation) = movers.get(int(body), -1), pose
    if mover < 0:
        return mover, pose
    turn = data.xmat[body].reshape(3, 3)
    return mover, (turn.T @ (position - data.xpos[body]), turn.T @ rotation)


def marks_of(model: mujoco.MjModel, data: mujoco.MjData) -> list[Rigid]:
    """Returns visible sites as panes of glass.

    Raises:
        InvalidArgumentError: If a site is not a box.
    """
    found = []
    for site in np.flatnonzero(model.site_group < SHOWN_SITES):
        kind = int(model.site_type[site])
        if kind != _BOX:
            raise InvalidArgumentError("site", mujoco.mjtGeom(kind).name, "boxes")
        material = material_of(model, model.site_matid[site], model.site_rgba[site], [])
        pane = box(model.site_size[site])
        pane = pane.moved(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
        found.append(Rigid(-1, 0, pane, material))
    return found
