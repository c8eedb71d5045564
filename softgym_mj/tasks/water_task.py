"""`WaterTask`: what the tasks on water in cups share."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.metrics import Array
from softgym_mj.robots.cup_mover import CupMover
from softgym_mj.robots.models import ARMS
from softgym_mj.tasks.shared.starts.cups import LARGEST_COUNT, Scene, num_particles
from softgym_mj.tasks.shared.starts.settled_water import SettledWater
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.stored_task import StoredTask
from softgym_mj.variations.store import VariationStore

# [kg/m^3] Cups hold up to 26 kg of water, more than the 3 and 4 kg that the arms can carry: theirs
# is as viscous, but a tenth as heavy.
ARM_DENSITY = 100.0
MIDDLE = 0.6  # [m] Cups move and stand between x = -0.25 and 1.4.


def make_water(actor: str, liquid: Liquid, resolution: Resolution, draw: str) -> Water:
    """Builds the water for an actor's cup: arms feel it, and it is light enough for them.

    Args:
        actor: one of `factory.CUP_ACTORS`.
        liquid, resolution, draw: as in `Water`.
    """
    if actor in ARMS:
        lighter = dataclasses.replace(liquid, density=ARM_DENSITY)
        return Water(lighter, resolution, draw, two_way=True)
    return Water(liquid, resolution, draw)


def cup_state(name: str, state: State, episode: Episode) -> dict[str, Array]:
    """A cup's pose and inner measures by what they are."""
    pose, size = state.poses[name], episode.shapes[name]["size"]
    return {
        f"{name} x, z [m]": pose[..., :3:2],
        f"{name} theta [rad]": pose[..., 7:],
        f"{name} inner length, width, height [m]": size[..., :3],
    }


class WaterTask(StoredTask):
    """A task on water in a cup that the actor moves, and perhaps further cups that stand still.

    Full state: all particles (x, y, z each [m]), zeros up to the largest sample of this fidelity
    (8788 times 1/2, 1 or 2), then each cup's pose and inner measures: x, z [m], theta [rad],
    length, width, height [m], the moved cup first, and what an arm senses of itself, which also
    ends the reduced state.
    """

    _actor: CupMover

    def __init__(
        self,
        camera: str,
        success: float,
        initializer: SettledWater,
        water: Water,
        cups: Sequence[Cup],
        actor: CupMover,
        **settings,
    ):
        """Wires the parts together.

        Args:
            camera: name of the task's camera in `arena.CAMERAS`.
            success: normalised performance from which the goal counts as reached.
            initializer: the initial states.
            water: the water, not yet attached.
            cups: the actor's cup, then those that stand still; not yet attached.
            actor: what acts, not yet attached.
            **settings: observation, image_size, action_repeat and domain as in `DeformableTask`.
        """
        self._initializer, self._water, self._cups = initializer, water, tuple(cups)
        self._scene = initializer.scenes.scene(0)
        arena = Arena(camera=camera + actor.camera_suffix, middle=MIDDLE)
        actor.join(arena)
        for cup in self._cups[1:]:
            cup.join(arena)
        arena.attach(water)
        water.confine(*(cup.body for cup in self._cups))
        super().__init__(
            arena,
            actor,
            VariationStore(initializer),
            timestep=water.timestep,
            success=success,
            max_points=num_particles(LARGEST_COUNT, initializer.fidelity),
            adjustable=(water,),
            **settings,
        )

    @property
    def actor(self) -> CupMover:
        """What moves the first cup."""
        return self._actor

    @property
    def water(self) -> Water:
        """The water."""
        return self._water

    @property
    def cup(self) -> Cup:
        """The cup that the actor moves."""
        return self._cups[0]

    @property
    def scene(self) -> Scene:
        """Sizes and places of the current variation."""
        return self._scene

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        cups = tuple(cup.mjcf_model.model for cup in self._cups)
        return {"container": cups, "actor": self._actor.model_names}

    def resize(self, variation: int) -> bool:
        self._scene = scene = self._initializer.scenes.scene(variation)
        changed = [cup.resize(size) for cup, size in zip(self._cups, scene.cups, strict=True)]
        return self._water.resize(scene.resolution(self._initializer.fidelity)) or any(changed)

    def start(self, state: np.ndarray) -> None:
        for cup, x in zip(self._cups[1:], self._scene.places[1:], strict=True):
            cup.pose = np.array([x, 0.0, 0.0])
        self._actor.place(np.zeros(3))
        self._water.set_particles(state)

    def object_points(self) -> dict[str, np.ndarray]:
        return {"water": self._water.positions()}

    def poses(self) -> dict[str, np.ndarray]:
        return {cup.mjcf_model.model: cup.whole_pose for cup in self._cups}

    def shapes(self) -> dict[str, dict[str, np.ndarray]]:
        return {
            cup.mjcf_model.model: {"size": np.array(dataclasses.astuple(cup.size))}
            for cup in self._cups
        }

    def sensed(self) -> np.ndarray:
        return self._actor.arm_state()

    def beside(self, state: State, episode: Episode) -> dict[str, Array]:
        cups = (cup_state(name, state, episode) for name in state.poses)
        return {name: values for cup in cups for name, values in cup.items()}


def inside(name: str, state: State, episode: Episode) -> Array:
    """Which particles (..., n) are in a cup's box."""
    return metrics.inside(state.points["water"], state.poses[name], episode.shapes[name]["size"])
