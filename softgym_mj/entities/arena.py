"""The scene every task plays in: a table in a room, its lights and cameras."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from dm_control import composer, mjcf
from scipy.spatial.transform import Rotation

from softgym_mj import assets
from softgym_mj.entities.flex import GRIPPER_CONTACT, OBJECT_CONTACT
from softgym_mj.entities.room import add_lights, add_room
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.kinds import typed
from softgym_mj.rendering.look import FAST, TEXT, Look
from softgym_mj.variations.parametric import Parametric
from softgym_mj.variations.randomization import Parameter, shifted


@typed
@dataclasses.dataclass(frozen=True)
class CameraPose:
    """Pose of a fixed camera in the world frame: position [m], quaternion (w, x, y, z)."""

    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @classmethod
    def looking(cls, position: Sequence[float], at: Sequence[float]) -> "CameraPose":
        """The upright camera at `position` (3,) [m] with `at` (3,) [m] in the middle of its image.

        Raises:
            InvalidArgumentError: if `at` lies straight above or below `position`, or at it.
        """
        back = np.subtract(position, at)
        right = np.cross([0.0, 0.0, 1.0], back)
        if not np.linalg.norm(right) > 0.0:
            raise InvalidArgumentError(
                "at", tuple(at), f"not on the vertical through {tuple(position)}"
            )
        axes = np.column_stack([right, np.cross(back, right), back])
        turn = Rotation.from_matrix(axes / np.linalg.norm(axes, axis=0))
        x, y, z = map(float, position)
        return cls((x, y, z), tuple(turn.as_quat(scalar_first=True).tolist()))


FIELD_OF_VIEW = 45.0  # Vertical [deg].
# From the front right, looking at the middle; the same from further away, where arms are in view.
OVERVIEW = CameraPose((0.8, -0.9, 0.65), (0.7948, 0.4920, 0.1870, 0.3022))
FAR_OVERVIEW = CameraPose((1.28, -1.53, 1.18), (0.7927, 0.5051, 0.1834, 0.2879))


@typed
@dataclasses.dataclass(frozen=True)
class View:
    """From where a scene is looked at.

    Attributes:
        camera: the task's camera.
        overview: the other fixed camera.
        with_arms: the task's camera where arms would hide what `camera` sees; None for `camera`.
        overview_with_arms: alike.
        middle: X [m] of the middle of what happens; shadows reach 1.5 m around it.
        best: the camera that shows a person most: "task" or "overview".
    """

    camera: CameraPose
    overview: CameraPose = OVERVIEW
    with_arms: CameraPose | None = None
    overview_with_arms: CameraPose = FAR_OVERVIEW
    middle: float = 0.0
    best: str = "task"


# SoftGym's cameras in z-up coordinates (facts 1.4); all have a field of view of 45 degrees. Those
# for arms are ours: opposite the one that holds a cup, else from the front, between the two. Cups
# move and stand between x = -0.25 and 1.4; before the camera of pour_water, to and fro.
VIEWS = {
    "transport_water": View(
        CameraPose((0.64, -0.85, 1.8), (0.9763, 0.2164, 0.0, 0.0)),
        with_arms=CameraPose((0.62, -1.75, 1.35), (0.8774, 0.4798, -0.0, -0.0)),
        overview_with_arms=CameraPose((1.5, -1.5, 1.3), (0.806, 0.4897, 0.1727, 0.2842)),
        middle=0.6,
        best="overview",
    ),
    "pour_water": View(
        CameraPose((1.4, -0.1, 1.5), (0.7345, 0.1968, 0.1681, 0.6273)),
        with_arms=CameraPose((0.5, -1.6, 1.0), (0.8141, 0.5807, -0.0, -0.0)),
        overview_with_arms=CameraPose((1.3, -1.4, 1.2), (0.7809, 0.521, 0.1912, 0.2867)),
        middle=0.6,
        best="overview",
    ),
    "rope": View(
        CameraPose((0.0, 0.0, 0.85), (1.0, 0.0, 0.0, 0.0)),
        with_arms=CameraPose((0.75, 0.0, 0.75), (0.6485, 0.2818, 0.2818, 0.6485)),
    ),
    "cloth": View(
        CameraPose((0.0, -0.82, 0.82), (0.9239, 0.3827, 0.0, 0.0)),
        with_arms=CameraPose((1.15, 0.0, 1.2), (0.6515, 0.2749, 0.2749, 0.6515)),
    ),
    "cloth_drop": View(
        CameraPose((1.072, -1.1569, 0.9494), (0.7915, 0.5259, 0.1724, 0.2595)),
        with_arms=CameraPose((1.9, 0.0, 1.1), (0.5615, 0.4299, 0.4299, 0.5615)),
        overview_with_arms=CameraPose((1.6, -1.9, 1.6), (0.783, 0.5191, 0.1894, 0.2858)),
    ),
}

_SHIFTS = tuple(
    shifted(f"camera_{axis}", "m", 0.02, 0.1, f"shift of the task's camera along {axis.upper()}")
    for axis in "xyz"
)
# Turns about the camera's own axes: right, up and backward.
_TURNS = tuple(
    shifted(f"camera_{turn}", "deg", 1.0, 5.0, f"turn of the task's camera {how}")
    for turn, how in (("tilt", "upward"), ("pan", "to the left"), ("roll", "counter-clockwise"))
)
SOLIDS = ("box", "sphere", "capsule", "cylinder", "ellipsoid")
# [s] With MuJoCo's 0.02 s a rope that hangs over a rod of 4 mm sinks through it: all its weight is
# borne by two light vertices. MuJoCo makes it twice the physics step at least.
_SOLID_TIME = 0.01

_BRIGHTNESS = Parameter(
    "floor_brightness", "", 1.0, (0.8, 1.0), (0.5, 1.0), "factor to the floor's colour"
)


class Arena(composer.Arena, Parametric):
    """A table, lights, the task's camera (named "task") and an "overview" camera.

    Attributes:
        view: from where it is looked at.
        parameters: domain parameters: the pose of the task's camera, the floor's colour.
    """

    parameters = (*_SHIFTS, *_TURNS, _BRIGHTNESS)

    def _build(
        self, view: View | str = "cloth", arms: bool = False, look: Look = FAST, name: str = "arena"
    ):
        """Builds the scene.

        Args:
            view: from where it is looked at, or its name in `VIEWS`.
            arms: whether robot arms are in it.
            look: how it is drawn.
            name: model name.

        Raises:
            InvalidArgumentError: for no view.
        """
        if not isinstance(view, View):
            if view not in tuple(VIEWS):
                names = ", ".join(map(repr, VIEWS))
                raise InvalidArgumentError("view", view, f"a View, or one of {names}")
            view = VIEWS[view]
        overview = view.overview_with_arms if arms else view.overview
        self._pose = view.with_arms if arms and view.with_arms is not None else view.camera
        self.view = view
        super()._build(name=name, xml_path=assets.path("arena.xml"))
        shift = np.array([view.middle, 0.0, 0.0])
        overview = dataclasses.replace(overview, position=tuple(overview.position + shift))
        for camera_name, pose in (("task", self._pose), ("overview", overview)):
            self._mjcf_root.worldbody.add(
                "camera", name=camera_name, pos=pose.position, quat=pose.quaternion,
                fovy=FIELD_OF_VIEW,
            )  # fmt: skip
        self._mjcf_root.custom.add("text", name=TEXT, data=look.name)
        add_room(self._mjcf_root, view.middle, look)
        add_lights(self._mjcf_root, view.middle, self._pose.quaternion, look)

    def _set_parameters(self) -> None:
        values = self._values
        camera = self._mjcf_root.find("camera", "task")
        camera.pos = np.array(self._pose.position) + [values[p.name] for p in _SHIFTS]
        turn = Rotation.from_euler("XYZ", [values[p.name] for p in _TURNS], degrees=True)
        pose = Rotation.from_quat(self._pose.quaternion, scalar_first=True)
        camera.quat = (pose * turn).as_quat(scalar_first=True)
        brightness = values[_BRIGHTNESS.name]
        self._mjcf_root.find("material", "table").rgba = [*[brightness] * 3, 1.0]

    def add_solid(self, type: str, **attributes: object) -> mjcf.Element:
        """Adds a rigid shape that stays where it is: a rod, a shelf, a table, a wall.

        Cloth, rope and rigid bodies lie on it, water stays in front of it, the hands of arms stop
        at it; their controllers do not know of it. Pickers pass through it.

        Args:
            type: "box", "sphere", "capsule", "cylinder" or "ellipsoid".
            **attributes: of MJCF's `geom`: size [m], pos or fromto [m], quat, rgba, friction, ...

        Returns:
            The geom.

        Raises:
            InvalidArgumentError: for another type.
        """
        check_name("type", type, SOLIDS)
        # Its own friction and softness count, whatever lies on it.
        contact = {
            "conaffinity": OBJECT_CONTACT | GRIPPER_CONTACT,
            "priority": 1,
            "solref": (_SOLID_TIME, 1.0),
        }
        return self._mjcf_root.worldbody.add("geom", type=type, **(contact | attributes))

    def compile(self, timestep: float, *entities: composer.Entity) -> mjcf.Physics:
        """Physics of the scene outside of an environment, with `entities` bound to it.

        Args:
            timestep: physics step [s].
            *entities: what is in the scene and reads or writes its state.
        """
        self._mjcf_root.option.timestep = timestep
        physics = mjcf.Physics.from_mjcf_model(self._mjcf_root)
        for entity in entities:
            entity.after_compile(physics, None)
        return physics
