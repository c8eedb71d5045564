"""`Picker`: SoftGym's abstract gripper, a solid sphere that can hold the nearest vertex."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from dm_control import mjcf

from softgym_mj.entities.flex import GRIPPER_CONTACT, slide_views
from softgym_mj.entities.room import add_material
from softgym_mj.exceptions import check_count
from softgym_mj.rendering.look import GRAPHITE, SIGNAL, STEEL
from softgym_mj.robots.grip import GripLimits
from softgym_mj.robots.gripper import Gripper
from softgym_mj.robots.holding import Attachment
from softgym_mj.robots.symmetry import ActorSymmetry, gripper_symmetry
from softgym_mj.robots.workspace import Workspace

# [kg] Pickers are driven by their velocity, which contacts take into account; a mocap body counts
# as at rest and would run through a rope. With this mass nothing pushes them aside: from 1 t on the
# cloth solver treats a body as driven.
MASS = 1e4
MOST_PICKERS = 32  # The starting ring of more pickers is wider than any workspace.
# Rendered parts in radii: from, to above the center, radius, surface. A ball of rubber, the
# collision shape, on a shaft with a collar.
_BALL = GRAPHITE
_PARTS = (
    ("collar", 0.76, 1.08, 0.60, SIGNAL),
    ("shaft", 1.08, 2.70, 0.26, STEEL),
)


@dataclasses.dataclass(frozen=True)
class Geometry:
    """Shape and contact of a picker.

    Attributes:
        radius: radius of the sphere [m].
        pick_distance: radius plus SoftGym's particle radius (0.00625 cloth, 0.025 rope) plus its
            threshold of 0.005 [m] (docs/softgym.md 2.1).
        friction: friction coefficient between picker and object (SoftGym's).
    """

    radius: float
    pick_distance: float
    friction: float


CLOTH_GEOMETRY = Geometry(0.05, 0.06125, friction=0.75)
ROPE_GEOMETRY = Geometry(0.02, 0.05, friction=1.0)


class Picker(Gripper):
    """Pickers with the semantics of SoftGym (docs/softgym.md 2.4): see `grip.step_grips`.

    A held vertex keeps its offset to the picker, but is never pushed below its resting height on
    the floor. If pickers pull two vertices further apart than the object stretches, the one that
    was taken later is released: see `Attachment`.

    Attributes:
        radius: radius of the spheres [m].
        pick_distance: largest distance [m] between a picker's center and a vertex that it can take.
        slides, slide_velocities: (num_pickers, 3) [m], [m/s], views of the simulation state.
    """

    name = "picker"
    _holding: Attachment

    def _build(
        self, geometry: Geometry = CLOTH_GEOMETRY, num_pickers: int = 2, name: str = "picker"
    ):
        """Builds the pickers.

        Args:
            geometry: `CLOTH_GEOMETRY` or `ROPE_GEOMETRY`.
            num_pickers: number of pickers, 1..`MOST_PICKERS`.
            name: model name.
        """
        check_count("num_pickers", num_pickers, 1, MOST_PICKERS)
        self.radius, self.pick_distance = geometry.radius, geometry.pick_distance
        self._mjcf_root = mjcf.RootElement(model=name)
        for part, surface in (("ball", _BALL), *((part[0], part[-1]) for part in _PARTS)):
            add_material(self._mjcf_root, part, surface)
        for i in range(num_pickers):
            body = self._mjcf_root.worldbody.add("body", name=f"picker_{i}", gravcomp=1)
            for axis, direction in zip("xyz", np.eye(3), strict=True):
                body.add("joint", name=f"picker_{i}_{axis}", type="slide", axis=direction)
            body.add(
                "geom",
                name=f"picker_{i}",
                type="sphere",
                size=[self.radius],
                mass=MASS,
                contype=GRIPPER_CONTACT,
                conaffinity=0,
                condim=3,
                friction=[geometry.friction],
                priority=1,
                material="ball",
            )
            for part, low, high, radius, _ in _PARTS:
                height, half = (low + high) / 2 * self.radius, (high - low) / 2 * self.radius
                body.add(
                    "geom", type="cylinder", pos=[0.0, 0.0, height], material=part,
                    size=[radius * self.radius, half], contype=0, conaffinity=0, mass=0.0,
                )  # fmt: skip
        self._holding = Attachment(num_pickers)
        self._step = np.zeros((num_pickers, 3))  # Displacement in the current sim step [m].
        self._set_workspace(Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)))

    def after_compile(self, physics, random_state):
        model, data = physics.model.ptr, physics.data.ptr
        bodies = [
            model.body(f"{self._mjcf_root.model}/picker_{i}").id for i in range(self.num_grippers)
        ]
        self.slides, self.slide_velocities = slide_views(model, data, bodies)

    def default_positions(self, point: np.ndarray) -> np.ndarray:
        # docs/softgym.md 2.3: a ring of radius 2 r sqrt(n - 1) from FleX's +z, which is -Y here.
        number = self.num_grippers
        angles = [2 * math.pi * i / number for i in range(number)]
        ring = 2 * self.radius * math.sqrt(number - 1)
        offsets = np.array([(math.sin(angle), -math.cos(angle), 0.0) for angle in angles])
        return np.asarray(point) + ring * offsets

    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        self._holding.reset()
        self._set_workspace(workspace)
        self._center[:] = positions
        self.slides[:] = positions
        self.slide_velocities[:] = 0.0

    def _set_workspace(self, workspace: Workspace):
        super()._set_workspace(workspace)
        self._low = np.asarray(workspace.low) + self.radius
        self._high = np.asarray(workspace.high) - self.radius
        low, high = (np.tile(end, (self.num_grippers, 1)) for end in (self._low, self._high))
        self._limits = GripLimits(low, high, self.pick_distance)

    @property
    def _center(self) -> np.ndarray:
        return self._holding.grips.center

    def plan(self) -> None:
        before = self._center
        self._holding.step(self._command, self._limits)
        self._step = self._center - before

    def take(self, vertices: Sequence[int]) -> None:
        for i, vertex in enumerate(vertices):
            self._holding.take(i, vertex, self._target.vertex(vertex) - self._center[i])

    def move(self, fraction: float, timestep: float) -> None:
        position = self._center
        if fraction < 1.0:
            position = position - (1.0 - fraction) * self._step
        np.subtract(position, self.slides, out=self.slide_velocities)
        self.slide_velocities /= timestep
        self._holding.drive(position, timestep)

    def symmetries(self, turn: np.ndarray) -> Sequence[ActorSymmetry]:
        order = range(self.num_grippers)
        return [gripper_symmetry(turn, each) for each in (order, order[::-1])[: len(order)]]

    def held_positions(self) -> np.ndarray:
        """Returns the targets of held vertices (num_pickers, 3) [m]; NaN for none."""
        return self._holding.places(self._center)

    def positions(self) -> np.ndarray:
        return self._center.copy()
