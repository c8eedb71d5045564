"""`Scene`: the objects of a task and what acts on them, in an arena."""

import math
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
from softgym_mj.tasks.shared.state import State
from softgym_mj.variations.randomization import Adjustable, Prefixed

MOST_SPEED = 20.0  # [m/s] Ten times what grippers do; in 10^5 random steps nothing comes near it.


class Scene:
    """What the methods of a task read and place.

    Attributes:
        arena: the floor and the cameras, with everything in it.
        materials: what deforms or flows, by model name.
        sensor: what images that are observed have been taken with.
        cups: that of the actor, then those that stand still.
        flexes: what grippers can hold: the vertices of all flexes, numbered on in their order.
        most_strained: largest relative elongation of an edge at an end of an env step in this
            episode, as `note_strain` finds it.
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
        """Puts everything into an arena.

        Args:
            objects: what deforms or flows, and cups that stand still; not yet attached.
            actor: what acts, alike.
            held: the cup that it moves, if it does.
            view: from where the scene is looked at.
            marks: what shows the goal, not yet attached.
            look: how everything is drawn.
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
        self.most_strained = 0.0

    @property
    def objects(self) -> tuple[Flex | Water | Cup, ...]:
        """What deforms or flows, then the cups."""
        return (*self.materials.values(), *self.cups)

    @property
    def adjustable(self) -> list[Adjustable]:
        """What has domain parameters; with several objects, names tell whose."""
        parts = self.materials.items()
        several = len(parts) > 1
        return [
            *self.arena.adjustable,
            self.sensor,
            *(Prefixed(part, name) if several else part for name, part in parts),
        ]

    @property
    def segmentation_models(self) -> dict[str, tuple[str, ...]]:
        """Names of the models that segmented images show as "actor" or "container"."""
        cups = tuple(cup.mjcf_model.model for cup in self.cups)
        return {"container": cups, "actor": self._actor.model_names}

    def resize(self, sizes: Sequence[Any]) -> bool:
        """Gives the first objects other sizes; True when the model must be recompiled."""
        # A list: `any` would stop at the first that has changed.
        pairs: Iterable[Any] = zip(self.objects, sizes, strict=False)
        return any([thing.resize(size) for thing, size in pairs])

    def compiled(self, physics) -> None:
        """Forgets what depends on sizes."""
        self._present, self._data = {}, physics.data.ptr

    def seen(self, name: str, images: np.ndarray, variation: int) -> np.ndarray:
        """What is observed now, in a variation, of drawn images (..., height, width, 3) uint8."""
        return self.sensor.seen(images, name, variation, self._data.time)

    # ------------------------------------------------------------------ states

    def points(self) -> dict[str, np.ndarray]:
        """Points (n, 3) [m] of each object that deforms or flows, by name."""
        return {name: thing.points() for name, thing in self.materials.items()}

    def shapes(self) -> dict[str, dict[str, np.ndarray]]:
        """What depends on the sizes of objects, by object and name."""
        return {thing.mjcf_model.model: thing.arrays for thing in self.objects}

    def state(self) -> State:
        """The current state."""
        points = self.points()
        if not self._present:
            self._present = {name: np.ones(len(array), bool) for name, array in points.items()}
        poses = {cup.mjcf_model.model: cup.whole_pose for cup in self.cups}
        actor = self._actor
        return State(points, self._present, poses, actor.proprioception(), actor.remembered())

    def check_finite(self) -> None:
        """Raises `PhysicsError`, and counts a warning, if the state is not finite, or is huge.

        MuJoCo looks at positions and velocities only at the start of its next step.
        """
        waters = [thing.motion for thing in self.materials.values() if isinstance(thing, Water)]
        arrays = (self._data.qpos, self._data.qvel, *waters)
        # Sums of squares: a tenth of the time that looking for the largest takes.
        if not all(array.dot(array) < mujoco.mjMAXVAL**2 for array in arrays):
            self._data.warning.number[mujoco.mjtWarning.mjWARN_BADQPOS] += 1
            raise PhysicsError("the simulation has diverged")

    def note_strain(self, starts: bool = False) -> None:
        """Keeps the largest strain of an episode, which may have just started."""
        before = -math.inf if starts else self.most_strained
        self.most_strained = max(before, self.flexes.most_strained())

    def diagnostics(self, count_intersections: bool) -> dict[str, float | int]:
        """Scalars about the flexes, for info."""
        if not self.flexes.flexes:
            return {}
        speed = self.flexes.fastest()
        if speed > MOST_SPEED:
            warnings.warn(
                f"a vertex moves at {speed:.0f} m/s; expected {MOST_SPEED:.0f} m/s at most: "
                "something pulls or presses harder than the object can stand",
                stacklevel=2,
            )
        found = {
            "max_edge_strain": self.flexes.most_strained(),
            "episode_max_edge_strain": self.most_strained,
            "max_speed": speed,
        }
        if count_intersections:
            sheets = (flex for flex in self.flexes.flexes if isinstance(flex, Sheet))
            found["intersections"] = sum(sheet.intersections() for sheet in sheets)
        return found
