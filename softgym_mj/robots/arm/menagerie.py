"""Arms with the appearance of MuJoCo Menagerie's: its visual geoms in place of ours.

Kinematics, inertias, servos and collision geoms stay ours, so the motion does not change. The
models come from the package `mujoco-menagerie`, which downloads each of them once.
"""

import pathlib
from typing import NoReturn

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.exceptions import UnavailableError, install_extra
from softgym_mj.robots.arm.models import Arm

VISUALS = ("primitive", "menagerie")
SHOWN_GROUPS = 3  # By default MuJoCo draws groups 0, 1 and 2.
CLASS = "menagerie"  # Default class of the copied geoms, and prefix of their assets.


def replace_visuals(model: mjcf.RootElement, arm: Arm) -> None:
    """Replaces the visual geoms of an arm by those in Menagerie, with meshes and colors.

    A link gets the geoms of the body of the same name; bodies that Menagerie lacks (the gripper of
    its Sawyer) keep ours. Textures are not copied: these arms have none.

    Args:
        model: the model of `arm`, not yet attached to a scene.
        arm: kind of arm.

    Raises:
        UnavailableError: if the package `mujoco-menagerie` is not installed, or the model can
            neither be found nor downloaded, or has no body of the arm.
    """
    try:
        spec = _spec(arm)
        source = spec.compile()
        bodies = _common_bodies(source, arm)
        _Copy(spec, source, model).replace(bodies)
    except (OSError, ValueError) as error:  # Errors of MuJoCo and of files.
        _fail(arm, error)


def _spec(arm: Arm) -> mujoco.MjSpec:
    try:
        import mujoco_menagerie
    except ImportError as error:
        raise UnavailableError(
            f"visual='menagerie' needs the package mujoco-menagerie: {install_extra('menagerie')}"
        ) from error
    try:
        robot = mujoco_menagerie.get(arm.menagerie)
        return robot.spec(robot.default_model)
    except mujoco_menagerie.MenagerieError as error:
        _fail(arm, error)


def _fail(arm: Arm, reason: object) -> NoReturn:
    raise UnavailableError(
        f"visual='menagerie' cannot show {arm.name!r} as {arm.menagerie!r}: {reason}. This model "
        "is downloaded from github.com when first used; or set MENAGERIE_ROOT to a clone of "
        "https://github.com/google-deepmind/mujoco_menagerie, or leave visual='primitive'."
    )


def _common_bodies(source: mujoco.MjModel, arm: Arm) -> list[str]:
    """Returns the bodies of an arm that Menagerie's has, too.

    Raises:
        UnavailableError: if it has none.
    """
    model = mujoco.MjModel.from_xml_path(arm.xml_path)
    theirs = {source.body(i).name for i in range(1, source.nbody)}
    common = [name for i in range(1, model.nbody) if (name := model.body(i).name) in theirs]
    if not common:
        _fail(arm, "it has no body of the same name")
    return common


class _Copy:
    """Copies visual geoms and their assets from a compiled model to an MJCF model."""

    def __init__(self, spec: mujoco.MjSpec, source: mujoco.MjModel, target: mjcf.RootElement):
        self._source, self._target = source, target
        self._folder = pathlib.Path(spec.modelfiledir, spec.meshdir)
        self._meshes = {mesh.id: mesh for mesh in spec.meshes}
        shapes = target.default.add("default", dclass=CLASS).geom
        shapes.group, shapes.contype, shapes.conaffinity, shapes.mass = 2, 0, 0, 0.0

    def replace(self, bodies: list[str]) -> None:
        """Replaces the visual geoms of these bodies if the source has any."""
        for name in bodies:
            shapes = self._shapes(self._source.body(name).id)
            if not shapes:
                continue
            body = self._target.find("body", name)
            for geom in [geom for geom in body.geom if geom.dclass.dclass == "visual"]:
                geom.remove()
            for shape in shapes:
                self._add(body, shape)

    def _shapes(self, body: int) -> list[int]:
        model = self._source
        solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        shown = (model.geom_bodyid == body) & ~solid & (model.geom_group < SHOWN_GROUPS)
        return np.flatnonzero(shown).tolist()

    def _add(self, body: mjcf.Element, shape: int) -> None:
        model = self._source
        position, quaternion = model.geom_pos[shape].copy(), model.geom_quat[shape].copy()
        geom = body.add("geom", dclass=CLASS, rgba=model.geom_rgba[shape])
        if model.geom_type[shape] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[shape]
            geom.type, geom.mesh = "mesh", self._mesh(mesh)
            # The compiler moved the mesh to its center of mass and principal axes.
            back, turned_back = np.empty(3), np.empty(4)
            mujoco.mju_negPose(back, turned_back, model.mesh_pos[mesh], model.mesh_quat[mesh])
            mujoco.mju_mulPose(
                position, quaternion, position.copy(), quaternion.copy(), back, turned_back
            )
        else:
            kind = mujoco.mjtGeom(model.geom_type[shape]).name
            geom.type, geom.size = kind.removeprefix("mjGEOM_").lower(), model.geom_size[shape]
        geom.pos, geom.quat = position, quaternion
        if model.geom_matid[shape] >= 0:
            geom.material = self._material(model.geom_matid[shape])

    def _mesh(self, number: int) -> mjcf.Element:
        mesh = self._meshes[number]
        file = self._folder / mesh.file
        return self._asset(
            "mesh",
            self._source.mesh(number).name,
            file=mjcf.Asset(file.read_bytes(), file.suffix),
            scale=mesh.scale,
            refpos=mesh.refpos,
            refquat=mesh.refquat,
            smoothnormal=bool(mesh.smoothnormal),
            inertia="shell",  # Not used; exists of an open surface, too.
        )

    def _material(self, number: int) -> mjcf.Element:
        material = self._source.material(number)
        shares = ("emission", "specular", "shininess", "reflectance")
        look = {share: getattr(material, share)[0] for share in shares}
        return self._asset("material", material.name, rgba=material.rgba, **look)

    def _asset(self, kind: str, name: str, **attributes: object) -> mjcf.Element:
        """Returns the target's asset of this kind and name, adding it if missing."""
        name = f"{CLASS}_{name}"
        asset = self._target.find(kind, name)
        return asset or self._target.asset.add(kind, name=name, **attributes)
