"""`Scene`: the objects of a task and its actor, in an arena."""

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import mujoco
import numpy as np
from dm_control import composer
from dm_control.rl.control import PhysicsError

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.entities.sheet import Sheet
from softgym_mj.entities.views import View
from softgym_mj.fluid import Water
from softgym_mj.rendering.look import Look
from softgym_mj.robots.base import Actor
from softgym_mj.tasks.shared.sensor import TaskSensor
from softgym_mj.tasks.shared.state import Named, State
from softgym_mj.variations.randomization import Adjustable, Prefixed

MOST_SPEED = 20.0  # [m/s] Ten times the speed of grippers; 10^5 random steps stay far below it.


class Scene:
    """Objects of a task and its actor.

    Attributes:
        arena: floor and cameras, with everything attached.
        materials: objects that deform or flow, by model name.
        sensor: sensor of observed images.
        cups: the actor's cup, then those that stand still.
        flexes: vertices of all flexes, numbered consecutively: what grippers can hold.
        strain: largest relative elongation of an edge after the last env step or reset, updated by
            `note_strain`.
        most_strained: largest `strain` of this episode.
    """

    def __init__(
        self,
        objects: Sequence[Flex | Water | Cup],
        actor: Actor,
        held: Sequence[Cup],
        view: View | str,
        marks: Sequence[composer.Entity],
        look: Look,
    ):
        """Attaches everything to an arena.

        Args:
            objects: objects that deform or flow, and cups that stand still; not yet attached.
            actor: the actor, not yet attached.
            held: the cup that it moves, if any.
            view: camera view of the scene.
            marks: entities that mark the goal, not yet attached.
            look: rendering detail.
        """
        self._actor = actor
        self.materials = {o.mjcf_model.model: o for o in objects if not isinstance(o, Cup)}
        self.cups = [*held, *(thing for thing in objects if isinstance(thing, Cup))]
        self.flexes = FlexGroup([o for o in self.materials.values() if isinstance(o, Flex)])
        self.arena = Arena(view, actor.hides_view, look)
        self.sensor = TaskSensor()
        for thing in self.objects:
            thing.set_look(look)
        for flex in self.flexes.flexes:
            self.arena.attach(flex)
        actor.join(self.arena)
        actor.manipulate(self.flexes)
        for cup in self.cups[len(held) :]:
            cup.join(self.arena)
        for thing in (*self.materials.values(), *marks):
            if thing not in self.flexes.flexes:
                self.arena.attach(thing)
        self._present: dict[str, np.ndarray] = {}
        self.strain = self.most_strained = 0.0

    @property
    def objects(self) -> tuple[Flex | Water | Cup, ...]:
        """Objects that deform or flow, then the cups."""
        return (*self.materials.values(), *self.cups)

    @property
    def adjustable(self) -> list[Adjustable]:
        """Everything with domain parameters; with several objects, names are prefixed by theirs."""
        parts = self.materials.items()
        several = len(parts) > 1
        return [
            *self.arena.adjustable,
            self.sensor,
            *(Prefixed(part, name) if several else part for name, part in parts),
        ]

    @property
    def segmentation_models(self) -> dict[str, tuple[str, ...]]:
        """Model names labeled "actor" or "container" in segmentation images."""
        cups = tuple(cup.mjcf_model.model for cup in self.cups)
        return {"container": cups, "actor": self._actor.model_names}

    def resize(self, sizes: Sequence[Any]) -> bool:
        """Resizes the first objects; returns True if the model must be recompiled."""
        # A list, because `any` would stop at the first change.
        pairs: Iterable[Any] = zip(self.objects, sizes, strict=False)
        return any([thing.resize(size) for thing, size in pairs])

    def compiled(self, physics) -> None:
        """Clears values that depend on sizes."""
        self._present, self._data = {}, physics.data.ptr

    def seen(self, name: str, images: np.ndarray, variation: int) -> np.ndarray:
        """Applies the sensor of a variation to rendered images (..., height, width, 3) uint8."""
        return self.sensor.seen(images, name, variation, self._data.time)

    # ------------------------------------------------------------------ states

    def points(self) -> dict[str, np.ndarray]:
        """Returns points (n, 3) [m] of each object that deforms or flows, by name."""
        return {name: thing.points() for name, thing in self.materials.items()}

    def shapes(self) -> dict[str, dict[str, np.ndarray]]:
        """Returns arrays that depend on the sizes of objects, by object and name."""
        return {thing.mjcf_model.model: thing.arrays for thing in self.objects}

    def state(self) -> State:
        """Returns the current state."""
        points = self.points()
        if not self._present:
            present = {name: np.ones(len(array), bool) for name, array in points.items()}
            self._present = Named("state.present", present)
        poses = {cup.mjcf_model.model: cup.whole_pose for cup in self.cups}
        return State(
            Named("state.points", points), self._present, Named("state.poses", poses),
            self._actor.proprioception(), self._actor.remembered(),
        )  # fmt: skip

    def check_finite(self) -> None:
        """Raises `PhysicsError`, and counts a warning, if the state is not finite or too large.

        MuJoCo checks positions and velocities only at the start of its next step.
        """
        waters = [thing.motion for thing in self.materials.values() if isinstance(thing, Water)]
        arrays = (self._data.qpos, self._data.qvel, *waters)
        # Sums of squares take a tenth of the time of a search for the largest.
        if not all(array.dot(array) < mujoco.mjMAXVAL**2 for array in arrays):
            self._data.warning.number[mujoco.mjtWarning.mjWARN_BADQPOS] += 1
            raise PhysicsError("the simulation has diverged")

    def note_strain(self, starts: bool = False) -> None:
        """Updates `strain` and that of an episode, which may have just started."""
        self.strain = self.flexes.most_strained()
        self.most_strained = self.strain if starts else max(self.most_strained, self.strain)

    def diagnostics(self, count_intersections: bool) -> dict[str, float | int]:
        """Returns scalars about the flexes, for info."""
        if not self.flexes.flexes:
            return {}
        speed = self.flexes.fastest()
        if speed > MOST_SPEED:
            warnings.warn(
                f"a vertex moves at {speed:.0f} m/s; expected {MOST_SPEED:.0f} m/s at most: "
                "forces on the object may be too large",
                stacklevel=2,
            )
        info = {
            "max_edge_strain": self.strain,
            "episode_max_edge_strain": self.most_strained,
            "max_speed": speed,
        }
        if count_intersections:
            sheets = (flex for flex in self.flexes.flexes if isinstance(flex, Sheet))
            info["intersections"] = sum(sheet.intersections() for sheet in sheets)
        return info
