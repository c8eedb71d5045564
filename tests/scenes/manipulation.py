"""A cloth and two pickers without a task: scripted folds and drops."""

import dataclasses

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.gripper import MAX_DISPLACEMENT
from softgym_mj.robots.picker import Picker
from softgym_mj.robots.workspace import Workspace

_WORKSPACE = Workspace((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5))
_GRIP_HEIGHT = 0.055  # Picker center above the vertex it takes [m]: the sphere just touches it.
_PARKED = 0.6  # Height [m] to which pickers retreat after a release.
_INTERSECTION_INTERVAL = 10  # Sim steps between two intersection counts.


@dataclasses.dataclass
class Record:
    """What a scripted motion did to the cloth.

    Attributes:
        held_error: largest distance [m] of a held vertex from where its picker holds it.
        strain_99: 99th percentile of the edge strain, largest over time.
        lowest: lowest vertex [m].
        max_speeds: largest vertex speed [m/s] in every sim step since the release.
        most_intersections: most edge-triangle intersections seen, every 10th sim step.
        end_intersections: intersections at the end.
        warnings: MuJoCo warnings.
    """

    held_error: float = 0.0
    strain_99: float = 0.0
    lowest: float = np.inf
    max_speeds: list[float] = dataclasses.field(default_factory=list)
    most_intersections: int = 0
    end_intersections: int = 0
    warnings: int = 0

    def settle_time(self, speed: float = 0.02) -> float:
        """Time [s] after release from which every vertex stays slower than `speed` [m/s]."""
        moving = np.flatnonzero(np.array(self.max_speeds) >= speed)
        return SIM_STEP * (moving[-1] + 1) if len(moving) else 0.0


class ManipulationScene:
    """A flat cloth on the floor and two pickers, stepped by sim steps.

    Attributes:
        cloth, picker: the entities.
        physics: the dm_control physics.
        record: what has happened so far.
    """

    def __init__(self, cloth: Cloth):
        """Builds the scene."""
        self.cloth, self.picker, self.record = cloth, Picker(), Record()
        arena = Arena("cloth")
        arena.attach(cloth)
        self.picker.join(arena)
        self.picker.manipulate(cloth)
        self.physics = arena.compile(cloth.timestep, cloth, self.picker)
        cloth.set_points(cloth.flat())
        self.picker.place(self.picker.default_positions(np.array([0.0, 0.0, _PARKED])), _WORKSPACE)
        self._released = False
        self._count = 0

    def grip(self, vertices: list[int]) -> None:
        """Places the pickers on two vertices and closes them."""
        positions = np.array([self.cloth.vertex(i) for i in vertices]) + [0.0, 0.0, _GRIP_HEIGHT]
        self.picker.place(positions, _WORKSPACE)
        self.step(np.zeros((2, 3)), grip=True)
        if set(self.picker.held.tolist()) != set(vertices):
            raise RuntimeError(f"pickers hold {self.picker.held}, not {vertices}")

    def follow(self, path: np.ndarray, speed: float) -> None:
        """Carries both pickers along a path (n, 3) of displacements [m] at `speed` [m/s]."""
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        stops = np.arange(0.0, length[-1] + speed * SIM_STEP, speed * SIM_STEP)
        points = np.column_stack([np.interp(stops, length, path[:, i]) for i in range(3)])
        for displacement in np.diff(points, axis=0):
            self.step(np.tile(displacement, (2, 1)), grip=True)

    def release(self, duration: float) -> None:
        """Opens both pickers, which rise and stay away, for `duration` [s]."""
        self._released = True
        for _ in range(round(duration / SIM_STEP)):
            rise = min(MAX_DISPLACEMENT, _PARKED - self.picker.positions()[0, 2])
            self.step(np.tile([0.0, 0.0, max(rise, 0.0)], (2, 1)), grip=False)
        self.record.end_intersections = self.cloth.intersections()

    def step(self, displacement: np.ndarray, grip: bool) -> None:
        """One sim step; `displacement` (2, 3) [m], each at most 1 cm per axis."""
        action = np.column_stack([displacement / MAX_DISPLACEMENT, np.full(2, 2.0 * grip - 1.0)])
        self.picker.command(action.ravel())
        self.picker.plan()
        self.picker.move(1.0, SIM_STEP)
        mujoco.mj_step(self.physics.model.ptr, self.physics.data.ptr)
        self._measure()

    def _measure(self):
        record, vertices = self.record, self.cloth.points()
        for goal, vertex in zip(self.picker.held_positions(), self.picker.held, strict=True):
            if vertex >= 0:
                error = float(np.linalg.norm(vertices[vertex] - goal))
                record.held_error = max(record.held_error, error)
        strain = float(np.percentile(self.cloth.edge_strain(), 99))
        record.strain_99 = max(record.strain_99, strain)
        record.lowest = min(record.lowest, float(vertices[:, 2].min()))
        if self._released:
            speeds = np.linalg.norm(self.cloth.velocities(), axis=1)
            record.max_speeds.append(float(speeds.max()))
        self._count += 1
        if self._count % _INTERSECTION_INTERVAL == 0:
            record.most_intersections = max(record.most_intersections, self.cloth.intersections())
        record.warnings = int(self.physics.data.ptr.warning.number.sum())


def fold(scene: ManipulationScene, speed: float, rest: float = 2.0) -> None:
    """Folds column 0 onto the last column along a half ellipse at `speed` [m/s], then rests [s]."""
    corners = scene.cloth.corners
    scene.grip([int(corners[0]), int(corners[1])])
    width = scene.cloth.size[0]
    angle = np.linspace(0.0, np.pi, 500)
    # Slightly flatter than a circle so that the edge is never lifted off its own length, and
    # ending above the lower layer.
    radius, height = 0.49 * width, 0.45 * width
    landing = 0.012 * angle / np.pi
    path = np.column_stack(
        [radius * (1 - np.cos(angle)), np.zeros_like(angle), height * np.sin(angle) + landing]
    )
    scene.follow(path, speed)
    scene.release(rest)


def lift_and_release(scene: ManipulationScene, speed: float = 0.6) -> None:
    """Lifts two adjacent corners by 0.3 m at `speed` [m/s], drops them and rests for 2 s."""
    corners = scene.cloth.corners
    scene.grip([int(corners[0]), int(corners[1])])
    # Along a quarter circle about where the cloth leaves the floor, so that nothing is dragged.
    angle = np.linspace(0.0, np.pi / 2, 100)
    path = 0.3 * np.column_stack([1 - np.cos(angle), np.zeros_like(angle), np.sin(angle)])
    scene.follow(path, speed)
    scene.release(2.0)
