"""`FlexTask`: what the tasks on a cloth or a rope share."""

import dataclasses
import math
import warnings

import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import Flex
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.stored_task import StoredTask
from softgym_mj.variations.store import VariationStore

CLEARANCE = 0.06  # [m] At reset, of grippers' centres above the object: a picker's radius and 1 cm.
MOST_SPEED = 20.0  # [m/s] Ten times what grippers do; in 10^5 random steps nothing comes near it.


@dataclasses.dataclass(frozen=True)
class Layout:
    """The fixed numbers of a task.

    Attributes:
        camera: name of its camera in `arena.CAMERAS`.
        workspace: of the grippers; re-centred on the reset point.
        reset_height: height of the grippers at reset, above the reset point [m]; higher where the
            object is in their way.
        success: normalised performance from which the goal counts as reached.
    """

    camera: str
    workspace: Workspace
    reset_height: float
    success: float


class FlexTask(StoredTask):
    """A task on one flex that grippers handle.

    Full state: all vertices, zero-padded, then what the actor senses of itself. Points are x, y, z
    [m] each; pickers sense their centres, arms as `Arms.proprioception` says.
    """

    _actor: Gripper

    def __init__(
        self,
        layout: Layout,
        target: Flex,
        actor: Gripper,
        store: VariationStore,
        max_vertices: int,
        **settings,
    ):
        """Wires the parts together.

        Args:
            layout: the fixed numbers.
            target: the object, not yet attached.
            actor: what acts, not yet attached.
            store: the initial states.
            max_vertices: most vertices of any variation; the full state is zero-padded to it.
            **settings: observation, image_size, action_repeat and domain as in `DeformableTask`.
        """
        self._layout, self._target = layout, target
        arena = Arena(camera=layout.camera + actor.camera_suffix)
        arena.attach(target)
        actor.join(arena)
        actor.manipulate(target)
        super().__init__(
            arena,
            actor,
            store,
            timestep=target.timestep,
            success=layout.success,
            max_points=max_vertices,
            adjustable=(target,),
            **settings,
        )

    @property
    def target(self) -> Flex:
        """The deformable object."""
        return self._target

    @property
    def actor(self) -> Gripper:
        """The grippers."""
        return self._actor

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        return {"actor": self._actor.model_names}

    def reset_point(self) -> tuple[float, float]:
        """X, Y [m] that the grippers start around: the middle of the object's bounding box."""
        vertices = self._target.vertices()
        x, y = (vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2
        return float(x), float(y)

    def start(self, state: np.ndarray) -> None:
        self._target.set_vertices(state)
        x, y = self.reset_point()
        workspace = self._layout.workspace
        clear = min(float(state[:, 2].max()), workspace.high[2] - 2 * CLEARANCE) + CLEARANCE
        height = max(self._layout.reset_height, clear)
        positions = self._actor.default_positions(np.array([x, y, height]))
        self._actor.place(positions, workspace.centred_at(x, y))

    def object_points(self) -> dict[str, np.ndarray]:
        return {self._target.mjcf_model.model: self._target.vertices()}

    def sensed(self) -> np.ndarray:
        return self._actor.proprioception()

    def diagnostics(self) -> dict[str, float | int]:
        speed = math.sqrt(float((self._target.velocities() ** 2).sum(axis=1).max()))
        if speed > MOST_SPEED:
            warnings.warn(
                f"a vertex moves at {speed:.0f} m/s; expected {MOST_SPEED:.0f} m/s at most: "
                "something pulls or presses harder than the object can stand",
                stacklevel=2,
            )
        strain = float(np.max(self._target.edge_strain()))
        return {"max_edge_strain": strain, "max_speed": speed}
