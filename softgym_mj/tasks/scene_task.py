"""`SceneTask`: a task on any number of ropes, cloths, garments and waters in one scene."""

import abc
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.domain import Adjustable, Prefixed
from softgym_mj.entities.arena import Arena, CameraPose
from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.exceptions import OutOfRangeError
from softgym_mj.fluid import Water
from softgym_mj.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.base import DeformableTask, Entries
from softgym_mj.variations import generator

ACTION_REPEAT = 8  # As in most of SoftGym's tasks.
WORKSPACE = Workspace((-0.7, -0.6, 0.0), (0.7, 0.6, 0.6))
GRIPPERS_AT = (0.0, 0.0, 0.3)  # [m] Around which grippers start.
SUCCESS = 0.9


class SceneTask(DeformableTask):
    """A task on several objects, whose flexes grippers can hold.

    A subclass defines `arrange`, where things start, and `evaluate`, what is wanted.

    Full state: all points (x, y, z each [m]) of the objects in their order, then what the actor
    senses of itself. Reduced state: `key_points`, then the same.

    The physics step is the smallest that an object needs.
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
        domain: str | Mapping[str, object] = "nominal",
    ):
        """Puts the objects and the actor into an arena.

        Args:
            objects: what deforms or flows, at least one flex, with different model names; not yet
                attached. If there are several flexes, all have been given the same `FlexContact`
                as `self_contact`.
            actor: what acts, not yet attached.
            camera: the task's camera, or its name in `arena.CAMERAS`.
            workspace: of the grippers.
            grippers_at: point [m] around which they start.
            success: normalised performance from which the goal counts as reached.
            observation: "full", "reduced", "rgb" or a sequence of these.
            image_size: (height, width) of image observations [pixels].
            action_repeat: sim steps of 0.01 s per env step.
            domain: what varies besides the initial state, as in `Domain`; the parameters of an
                object have its model name before theirs: "rope_friction".

        Raises:
            OutOfRangeError: for objects without a flex, flexes that do not share their contact, or
                two of the same name.
            UnknownNameError: for a bad name.
        """
        self._objects = tuple(objects)
        flexes = [thing for thing in self._objects if isinstance(thing, Flex)]
        if not flexes:
            raise OutOfRangeError("objects", self._objects, "at least one rope, cloth or garment")
        self._flexes = FlexGroup(flexes)
        contact = flexes[0].contact
        if any(flex.contact is not contact or contact is None for flex in flexes[1:]):
            contacts = [
                flex.self_contact if flex.contact is None else flex.contact.mjcf_model.model
                for flex in flexes
            ]
            raise OutOfRangeError("self_contact", contacts, "one FlexContact that all flexes share")
        parts: list[Any] = [*self._objects, *([] if contact is None else [contact])]
        names = [part.mjcf_model.model for part in parts]
        if len(set(names)) < len(names):
            raise OutOfRangeError("objects", names, "a different `name` for each of them")
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
            timestep=min(thing.timestep for thing in self._objects),
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
        """Places the objects where an episode starts.

        Args:
            random: the generator of the current variation: the same for the same index.
        """

    def bounds(self) -> tuple[float, float]:
        """(lower, upper) performance that normalise to 0 and 1: performance is so by itself."""
        return 0.0, 1.0

    def key_points(self) -> np.ndarray:
        """Points (n, 3) [m] that the reduced state lists: the middle of every object."""
        return np.array([_points(thing).mean(axis=0) for thing in self._objects])

    @property
    def reduced_entries(self) -> tuple[Entries, ...]:
        names = (thing.mjcf_model.model for thing in self._objects)
        return tuple(Entries(f"middle of the {name} (x, y, z)", 3, "m") for name in names)

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
        positions = self._actor.default_positions(self._grippers_at)
        self._actor.place(positions, self._workspace)

    def points(self) -> np.ndarray:
        return np.concatenate([_points(thing) for thing in self._objects])

    def tool_state(self) -> np.ndarray:
        return self._actor.proprioception()

    def reduced_state(self) -> np.ndarray:
        """The key points (x, y, z each) [m], then what the actor senses of itself."""
        return np.concatenate([self.key_points().ravel(), self._actor.proprioception()])

    @property
    def state_layout(self) -> dict[str, object]:
        points = {thing.mjcf_model.model: _count(thing) for thing in self._objects}
        return {**super().state_layout, "points": points}


def _count(thing: Flex | Water) -> int:
    """Number of points of an object."""
    return thing.num_vertices if isinstance(thing, Flex) else thing.num_particles


def _points(thing: Flex | Water) -> np.ndarray:
    """Points (n, 3) [m] of an object."""
    return thing.vertices() if isinstance(thing, Flex) else thing.positions()
