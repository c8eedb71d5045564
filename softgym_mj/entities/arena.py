"""`Arena`: the scene of every task: a table in a room, lights and cameras."""

import dataclasses
import math

import numpy as np
from dm_control import composer, mjcf
from scipy.spatial.transform import Rotation

from softgym_mj import assets
from softgym_mj.entities.flex import GRIPPER_CONTACT, OBJECT_CONTACT
from softgym_mj.entities.lights import Lights
from softgym_mj.entities.room import Room
from softgym_mj.entities.views import EXTERNAL_AZIMUTHS, VIEWS, CameraPose, View
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.rendering.look import FAST, TEXT, Look
from softgym_mj.rendering.observables import EXTERNAL
from softgym_mj.validation import check_type
from softgym_mj.variations.parametric import Parametric
from softgym_mj.variations.randomization import Adjustable, shifted_parameter

_SHIFTS = tuple(
    shifted_parameter(
        f"camera_{axis}", "m", 0.02, 0.1, f"shift of the task's camera along {what}", "visual"
    )
    for axis, what in zip("xyz", "XYZ", strict=True)
)
# Rotations about the camera's own axes: right, up and backward.
_TURNS = tuple(
    shifted_parameter(
        f"camera_{turn}", "deg", 1.0, 5.0, f"turn of the task's camera {how}", "visual"
    )
    for turn, how in (("tilt", "upward"), ("pan", "to the left"), ("roll", "counter-clockwise"))
)
_ZOOM = shifted_parameter(
    "camera_fov", "deg", 1.5, 6.0, "change of the task's camera's field of view", "visual"
)
SOLIDS = ("box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh", "hfield")
# [s] Contact time constant. With MuJoCo's 0.02 s a rope that hangs over a rod of 4 mm sinks through
# it, since two light vertices bear its weight. MuJoCo raises it to at least twice the physics step.
_SOLID_TIME = 0.01


class Arena(composer.Arena, Parametric):
    """A table, lights and cameras: "task", "overview", and external depth cameras "left", "right".

    The external cameras face each other across the scene; no domain parameter moves them.

    Attributes:
        view: camera view.
        parameters: domain parameters of the task's camera.
        adjustable: parts with domain parameters: the arena, the room and the lights.
    """

    parameters = (*_SHIFTS, *_TURNS, _ZOOM)

    def _build(
        self, view: View | str = "cloth", arms: bool = False, look: Look = FAST, name: str = "arena"
    ):
        """Builds the scene.

        Args:
            view: camera view, or its name in `VIEWS`.
            arms: whether the scene has robot arms.
            look: rendering detail.
            name: model name.

        Raises:
            InvalidArgumentError: for an unknown view.
        """
        if not isinstance(view, View):
            if view not in tuple(VIEWS):
                names = ", ".join(map(repr, VIEWS))
                raise InvalidArgumentError("view", view, f"a View, or one of {names}")
            view = VIEWS[view]
        overview = view.overview_with_arms if arms else view.overview
        pose = view.with_arms if arms and view.with_arms is not None else view.camera
        self.view, self._has_arms = view, arms
        super()._build(name=name, xml_path=assets.path("arena.xml"))
        shift = np.array([view.middle, 0.0, 0.0])
        overview = dataclasses.replace(overview, position=tuple(overview.position + shift))
        cameras = {"task": pose, "overview": overview}
        for camera_name, turn in zip(EXTERNAL, EXTERNAL_AZIMUTHS, strict=True):
            cameras[camera_name] = view.external(pose.azimuth + math.radians(turn))
        for camera_name, place in cameras.items():
            self._mjcf_root.worldbody.add("camera", name=camera_name)
            self.place(camera_name, place)
        self._mjcf_root.custom.add("text", name=TEXT, data=look.name)
        room = Room(self._mjcf_root, view.middle, look)
        lights = Lights(self._mjcf_root, view.middle, pose.azimuth, look)
        self.adjustable: tuple[Adjustable, ...] = (self, room, lights)

    def place(self, name: str, pose: CameraPose) -> mjcf.Element:
        """Moves one of the arena's cameras before compilation; returns it."""
        if name == "task":
            self._pose = pose
        camera = self._mjcf_root.find("camera", name)
        camera.pos, camera.quat, camera.fovy = pose.position, pose.quaternion, pose.field_of_view
        return camera

    def _set_parameters(self) -> None:
        values = self._values
        camera = self._mjcf_root.find("camera", "task")
        camera.pos = np.array(self._pose.position) + [values[p.name] for p in _SHIFTS]
        turn = Rotation.from_euler("XYZ", [values[p.name] for p in _TURNS], degrees=True)
        pose = Rotation.from_quat(self._pose.quaternion, scalar_first=True)
        camera.quat = (pose * turn).as_quat(scalar_first=True)
        camera.fovy = self._pose.field_of_view + values[_ZOOM.name]

    def attach(
        self, entity: composer.Entity, attach_site: mjcf.Element | None = None
    ) -> mjcf.Element:
        check_type("entity", entity, composer.Entity)
        return super().attach(entity, attach_site)

    def add_solid(self, type: str, **attributes: object) -> mjcf.Element:
        """Adds a static rigid shape: a rod, a shelf, a table, a wall.

        It collides with cloth, rope, rigid bodies, water and the hands of arms, but not with
        pickers; controllers of arms do not avoid it. Water does not collide with meshes and
        heightfields, rigid bodies collide with the convex hull of a mesh.

        Args:
            type: "box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh" or "hfield".
            **attributes: attributes of MJCF's `geom`: size [m], pos or fromto [m], quat, rgba,
                friction, ..., and the mesh or hfield, an asset of `mjcf_model.asset`.

        Returns:
            The geom.

        Raises:
            InvalidArgumentError: for another type.
        """
        check_name("type", type, SOLIDS)
        # Its own friction and softness override those of what rests on it.
        contact = {
            "conaffinity": OBJECT_CONTACT | (GRIPPER_CONTACT if self._has_arms else 0),
            "priority": 1,
            "solref": (_SOLID_TIME, 1.0),
        }
        return self._mjcf_root.worldbody.add("geom", type=type, **(contact | attributes))

    def compile(self, timestep: float, *entities: composer.Entity) -> mjcf.Physics:
        """Compiles the scene outside of an environment, and binds `entities` to the physics.

        Args:
            timestep: physics step [s].
            *entities: entities that read or write its state.
        """
        self._mjcf_root.option.timestep = timestep
        physics = mjcf.Physics.from_mjcf_model(self._mjcf_root)
        for entity in entities:
            entity.after_compile(physics, None)
        return physics
