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
# Tolerances of a frame's position and rotation. Copies of these models with other kinematics differ
# by some centimeters or a quarter turn.
LARGEST_OFFSET, LARGEST_TURN = 1e-3, 1e-3  # [m], [rad]
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
            neither be found nor downloaded, or is of an arm with other joints or frames.
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
    """Returns bodies of an arm that Menagerie's has, too.

    Raises:
        UnavailableError: unless their frames agree.
    """
    model = mujoco.MjModel.from_xml_path(arm.xml_path)
    for joint in arm.joints:
        if _owner(source, joint) != _owner(model, joint):
            _fail(arm, f"it has no body {_owner(model, joint)!r} with a joint {joint!r}")
    ours, theirs = _frames(model, arm), _frames(source, arm)
    common = [key for key in ours if key in theirs]
    for kind, name in common:
        gaps = np.linalg.norm(ours[kind, name] - theirs[kind, name], axis=1)
        offset, turn = gaps[0], 2 * np.arcsin(np.minimum(gaps[1:].max() / 2, 1.0))
        if offset > LARGEST_OFFSET or turn > LARGEST_TURN:
            _fail(
                arm,
                f"{kind} {name!r} is {1e3 * offset:.1f} mm and {turn:.4f} rad from where ours is, "
                f"and at most {1e3 * LARGEST_OFFSET:g} mm and {LARGEST_TURN:g} rad would be the "
                "same arm",
            )
    return [name for kind, name in common if kind == "body"]


def _owner(model: mujoco.MjModel, joint: str) -> str | None:
    """Returns the body that a joint moves; None if there is no such joint."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint)
    return None if number < 0 else model.body(model.jnt_bodyid[number]).name


def _frames(model: mujoco.MjModel, arm: Arm) -> dict[tuple[str, str], np.ndarray]:
    """Returns the frames of an arm's bodies and joints in its home pose, relative to its base.

    Keys are kind and name. Bodies have position [m] and the three axes (4, 3), joints anchor [m]
    and axis (2, 3).
    """
    data = mujoco.MjData(model)
    for joint, angle in zip(arm.joints, arm.home, strict=True):
        data.qpos[model.joint(joint).qposadr] = angle
    mujoco.mj_kinematics(model, data)
    base = model.body_parentid[model.joint(arm.joints[0]).bodyid[0]]
    origin, axes = data.xpos[base], data.xmat[base].reshape(3, 3)
    frames = {}
    for i in range(1, model.nbody):
        turn = data.xmat[i].reshape(3, 3).T
        frames["body", model.body(i).name] = np.vstack([data.xpos[i] - origin, turn]) @ axes
    for i in range(model.njnt):
        line = np.vstack([data.xanchor[i] - origin, data.xaxis[i]])
        frames["joint", model.joint(i).name] = line @ axes
    return frames


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
