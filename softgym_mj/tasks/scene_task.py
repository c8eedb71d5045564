"""`SceneTask`: a task on any number of ropes, cloths, garments and waters in one scene."""

import abc
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.entities.arena import CAMERAS, Arena, CameraPose
from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.fluid import Water
from softgym_mj.metrics import Array
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.shared.base import DeformableTask
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import generator
from softgym_mj.variations.randomization import Adjustable, Prefixed

ACTION_REPEAT = 8  # As in most of SoftGym's tasks.
WORKSPACE = Workspace((-0.7, -0.6, 0.0), (0.7, 0.6, 0.6))
GRIPPERS_AT = (0.0, 0.0, 0.3)  # [m] Around which grippers start.
SUCCESS = 0.9
SUNK = 1e-3  # [m] By which points may start below the floor: those at rest lie above it.


class SceneTask(DeformableTask):
    """A task on several objects, whose flexes grippers can hold.

    A subclass defines `arrange`, where things start, and `measure`, what is wanted. One that
    remembers something of its own, such as a counter, changes it in `after_step` and makes it part
    of snapshots, which are exact then, too:

        def get_state(self):
            return {**super().get_state(), "count": self.count}

        def set_state(self, state):
            self.count = state["count"]
            super().set_state(state)  # Evaluates: what that needs is back by now.

    Full state: all points (x, y, z each [m]) of the objects in their order, then what the actor
    senses of itself. Reduced state: what `reduced` says, then the same.
    """

    _actor: Gripper

    def __init__(
        self,
        objects: Sequence[Flex | Water],
        actor: Gripper,
        *,
        camera: str | CameraPose = "cloth",
        workspace: Workspace = WORKSPACE,
        grippers_at: tuple[float, float, float] = GRIPPERS_AT,
        success: float = SUCCESS,
        observation: str | Sequence[str] = "reduced",
        image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
        action_repeat: int = ACTION_REPEAT,
        timestep: float | None = None,
        domain: str | Mapping[str, object] = "nominal",
    ):
        """Puts the objects and the actor into an arena.

        Args:
            objects: what deforms or flows, at least one flex, with different model names; not yet
                attached.
            actor: what acts, not yet attached.
            camera: the task's camera, or its name in `arena.CAMERAS`.
            workspace: of the grippers.
            grippers_at: point [m] around which they start.
            success: normalised performance from which the goal counts as reached.
            observation: "full", "reduced", "rgb" or a sequence of these.
            image_size: (height, width) of image observations [pixels].
            action_repeat: sim steps of 0.01 s per env step.
            timestep: physics step [s], a sim step or a whole part of it; by default the largest
                that suits all objects.
            domain: what varies besides the initial state, as in `Domain`; the parameters of an
                object have its model name before theirs: "rope_friction".

        Raises:
            InvalidArgumentError: for objects without a flex, two of the same name, or another
                argument of a wrong type; for a bad name.
        """
        _check_types(objects, actor, camera, workspace)
        self._objects = tuple(objects)
        flexes = [thing for thing in self._objects if isinstance(thing, Flex)]
        if not flexes:
            raise InvalidArgumentError(
                "objects", self._objects, "at least one rope, cloth or garment"
            )
        self._flexes = FlexGroup(flexes)
        parts: list[Any] = list(self._objects)
        names = [part.mjcf_model.model for part in parts]
        if len(set(names)) < len(names):
            raise InvalidArgumentError("objects", names, "a different `name` for each of them")
        self._workspace, self._grippers_at = workspace, np.array(grippers_at, float)
        if isinstance(camera, str):
            camera += actor.camera_suffix
        arena = Arena(camera=camera)
        for part in parts:
            arena.attach(part)
        actor.join(arena)
        actor.manipulate(self._flexes)
        adjustable: list[Adjustable] = [
            Prefixed(part, name) for part, name in zip(parts, names, strict=True)
        ]
        super().__init__(
            arena,
            actor,
            timestep=_checked_timestep(timestep, self._objects),
            success=success,
            max_points=sum(map(_count, self._objects)),
            adjustable=adjustable,
            observation=observation,
            image_size=image_size,
            action_repeat=action_repeat,
            domain=domain,
        )

    # ------------------------------------------------------------------ what a task defines

    @abc.abstractmethod
    def arrange(self, random: np.random.Generator) -> None:
        """Places the objects where an episode starts: finite, and not below the floor.

        Args:
            random: the generator of the current variation: the same for the same index and name
                of the class. A subclass, or a class with another name, starts elsewhere.
        """

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        """(lower, upper) performance that normalise to 0 and 1, lower < upper.

        Unless a task says otherwise its performance is from 0 to 1 by itself.
        """
        return 0.0, 1.0

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        """The middle of every object, unless a task says otherwise."""
        return {
            f"middle of the {name} (x, y, z) [m]": points.mean(axis=-2)
            for name, points in state.points.items()
        }

    # ------------------------------------------------------------------ parts

    @property
    def objects(self) -> tuple[Flex | Water, ...]:
        """What deforms or flows."""
        return self._objects

    @property
    def flexes(self) -> FlexGroup:
        """What the grippers can hold: the vertices of all flexes, numbered on in their order."""
        return self._flexes

    @property
    def actor(self) -> Gripper:
        return self._actor

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        return {"actor": self._actor.model_names}

    # ------------------------------------------------------------------ states

    def begin(self) -> None:
        self.arrange(generator(type(self).__name__, self.variation))
        self._check_points()
        positions = self._actor.default_positions(self._grippers_at)
        self._actor.place(positions, self._workspace)

    def initialize_episode(self, physics, random_state):
        super().initialize_episode(physics, random_state)
        bounds = np.asarray(self.bounds(self.episode), float)
        if bounds.shape != (2,) or not np.isfinite(bounds).all() or bounds[0] >= bounds[1]:
            found = self.bounds(self.episode)
            raise InvalidArgumentError("bounds()", found, "(lower, upper) with lower < upper")
        for name, found in self.reduced(self.state(), self.episode).items():
            values = np.asarray(found, float)
            if values.ndim > 2 or not np.isfinite(values).all():
                raise InvalidArgumentError(f"reduced()[{name!r}]", values, "finite numbers (n,)")

    def _check_points(self):
        """Raises `InvalidArgumentError` unless all starts above the floor, if there is one."""
        floor = self.root_entity.mjcf_model.find("geom", "floor")
        lowest = -np.inf if floor is None else (0.0 if floor.pos is None else floor.pos[2]) - SUNK
        for thing in self._objects:
            points, name = _points(thing), thing.mjcf_model.model
            if not np.isfinite(points).all():
                raise InvalidArgumentError(f"points of {name!r}", points.shape, "finite array")
            if points[:, 2].min() < lowest:
                height = float(points[:, 2].min())
                valid = "on the floor or above it [m]: `arrange` puts it there"
                raise InvalidArgumentError(f"lowest point of {name!r}", height, valid)

    def object_points(self) -> dict[str, np.ndarray]:
        return {thing.mjcf_model.model: _points(thing) for thing in self._objects}

    def sensed(self) -> np.ndarray:
        return self._actor.proprioception()

    @property
    def state_layout(self) -> dict[str, object]:
        points = {thing.mjcf_model.model: _count(thing) for thing in self._objects}
        return {**super().state_layout, "points": points}


def _check_types(objects: object, actor: object, camera: object, workspace: object) -> None:
    """Raises `InvalidArgumentError` for arguments of `SceneTask` of a wrong type."""
    if not isinstance(objects, Sequence) or not all(isinstance(o, Flex | Water) for o in objects):
        valid = "a list of ropes, cloths, garments and waters"
        raise InvalidArgumentError("objects", objects, valid)
    if not isinstance(actor, Gripper):
        valid = 'a Gripper, such as `robots.factory.make_actor("picker", "cloth")`'
        raise InvalidArgumentError("actor", actor, valid)
    if not isinstance(camera, str | CameraPose):
        names = ", ".join(repr(name) for name in CAMERAS)
        raise InvalidArgumentError("camera", camera, f"a CameraPose, or one of {names}")
    if not isinstance(workspace, Workspace):
        raise InvalidArgumentError("workspace", workspace, "a Workspace((x, y, z), (x, y, z))")


def _checked_timestep(timestep: float | None, objects: Sequence[Flex | Water]) -> float:
    """The physics step [s], if it suits the objects and goes into a sim step."""
    largest = min(thing.timestep for thing in objects)
    if timestep is None:
        return largest
    whole = 0.0 < timestep <= largest and np.isclose(SIM_STEP / timestep % 1.0, [0.0, 1.0]).any()
    if not whole:
        raise InvalidArgumentError("timestep", timestep, f"{SIM_STEP} s / n, at most {largest} s")
    return timestep


def _count(thing: Flex | Water) -> int:
    """Number of points of an object."""
    return thing.num_vertices if isinstance(thing, Flex) else thing.num_particles


def _points(thing: Flex | Water) -> np.ndarray:
    """Points (n, 3) [m] of an object."""
    return thing.vertices() if isinstance(thing, Flex) else thing.positions()
