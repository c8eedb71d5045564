"""`Cameras`: image observations of a batch of environments."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import cpu_only
from softgym_mj.metrics import Array
from softgym_mj.rendering.batch import Described, Pictures, describe
from softgym_mj.rendering.observables import EXTERNAL, EXTERNAL_RGB, WRIST_RGB
from softgym_mj.vector.batch.physics import Arrays, BatchPhysics


class _Image(NamedTuple):
    """An observation: by which cameras, a stack of their images or the only one, and of what."""

    cameras: tuple[str, ...]
    is_stack: bool
    shows: str


IMAGES = {
    "rgb": _Image(("task",), False, "colors"),
    "depth": _Image(("task",), False, "distances"),
    "segmentation": _Image(("task",), False, "labels"),
    EXTERNAL_RGB: _Image(EXTERNAL, True, "colors"),
    "external_depth": _Image(EXTERNAL, True, "distances"),
    WRIST_RGB: _Image((), True, "colors"),  # By the cameras of the actor.
}
_FAULTS = "sensor_"  # Prefix of domain parameters that degrade rendered images.


class Cameras:
    """Renders image observations.

    Attributes:
        observed: Names of the image observations.
        names: Names of their cameras.
    """

    def __init__(
        self,
        env: Environment,
        names: Sequence[str],
        num_envs: int,
        physics: BatchPhysics,
        device: Device,
    ):
        """Allocates images.

        Args:
            env: Environment with the size of images.
            names: Names of observations; images among them are rendered.
            num_envs: Number of environments.
            physics: Moving objects of the batch.
            device: Device of the batch.

        Raises:
            InvalidArgumentError: If sensor faults vary, which batches do not support.
        """
        self._xp, task = device.xp, env.task
        self._images = {name: IMAGES[name] for name in names if name in IMAGES}
        if WRIST_RGB in self._images:
            self._images[WRIST_RGB] = IMAGES[WRIST_RGB]._replace(cameras=task.actor.wrists)
        self.observed = tuple(self._images)
        wanted = {camera for image in self._images.values() for camera in image.cameras}
        every = "task", *EXTERNAL, *task.actor.wrists
        self.names = tuple(camera for camera in every if camera in wanted)
        if not self._images:
            return
        faults = [name for name in task.domain.varying if name.startswith(_FAULTS)]
        if faults and any(image.shows == "colors" for image in self._images.values()):
            raise cpu_only(f"an image with the sensor faults {faults}")
        self._has_marks = task.goal_marks
        name, image = next(iter(self._images.items()))
        shape = env.observation_spec()[name].shape[image.is_stack :]
        self._pictures = Pictures(
            num_envs, task.max_points, len(physics.movers()), len(self.names), shape[:2], device
        )

    @property
    def changed(self) -> int:
        """Number of times that its arrays have been replaced."""
        return self._pictures.grown if self._images else 0

    def read(self, env: Environment, physics: BatchPhysics) -> dict[str, Described]:
        """Describes the scene of a CPU environment, without poses, for `placed`."""
        if not self._images:
            return {}
        model, scene = env.physics.model.ptr, env.task.scene
        movers = {body: i for i, body in enumerate(physics.movers())}
        told = model, self.names, movers, scene.segmentation_models
        found = {"scene": describe(*told)}
        if self._has_marks:
            found["marked"] = describe(*told, marks=True)
        return found

    def placed(self, read: Mapping[str, Described]) -> Arrays:
        """Returns a row for `draw` from the result of `read` in any process."""
        return {name: np.array(self._pictures.load(described)) for name, described in read.items()}

    def draw(self, views: Mapping[str, Array], points: Array, poses: Array) -> dict[str, Array]:
        """Renders the images of all environments by name.

        Args:
            views: Rows from `placed`.
            points: Points of deformable objects (num_envs, most_points, 3) [m].
            poses: Positions [m] and quaternions of movers (num_envs, movers, 7).
        """
        seen: dict[str, Any] = {}
        told = points, poses
        shown = {image.shows for image in self._images.values()}
        if "colors" in shown:
            seen["colors"] = self._pictures.colors(
                views["marked" if self._has_marks else "scene"], *told
            )
        if shown - {"colors"}:
            seen["labels"], seen["distances"] = self._pictures.surfaces(views["scene"], *told)
        found = {}
        for name, image in self._images.items():
            first = self.names.index(image.cameras[0])
            stack = seen[image.shows][:, first : first + len(image.cameras)]
            found[name] = stack if image.is_stack else stack[:, 0]
        return found
