"""`Tank`: water in a box with an optional gate and obstacle, and what gauges measure in it."""

import dataclasses
import math

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth.fabrics import GRAVITY
from softgym_mj.exceptions import SimulationError, check_number
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.fluid.water import TIMESTEP
from softgym_mj.reality.solver import step

WALL = 0.05  # [m] Thickness; the motion of walls is swept, so that it does not matter.
NOISE = 0.01  # Noise of the lattice in spacings: a perfect one is an unstable equilibrium.
SETTLING = 150  # Damped steps before an experiment.
DAMPING = 0.95  # Factor of velocities in each of them.
GAUGE = 0.05  # [m] Approximate distance to which particles count for a gauge.
SCALE = 0.018  # [m] For finer particles steps are shorter, as times of fall are.


@dataclasses.dataclass(frozen=True)
class Box:
    """Axis-aligned box.

    Attributes:
        low, high: Corners (3,) [m].
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def size(self) -> np.ndarray:
        """Lengths of its edges (3,) [m]."""
        return np.subtract(self.high, self.low)


class Tank:
    """A tank with its floor at z = 0, from x = 0 on, and water at rest in it.

    Attributes:
        spacing: Spacing of particles [m], near the requested one: a whole number of particles, of
            spacing^3 each, has the volume of the water.
        timestep: Time step [s].
    """

    def __init__(
        self,
        size: tuple[float, float, float],
        water: Box,
        spacing: float,
        liquid: Liquid,
        obstacles: tuple[Box, ...] = (),
        gate: bool = False,
    ):
        """Builds the tank and lets the water come to rest.

        Args:
            size: Length along X, width along Y and height (3,) [m].
            water: Water at rest.
            spacing: Approximate spacing of particles [m].
            liquid: Properties of the water.
            obstacles: Boxes in the tank.
            gate: Whether a gate holds the water at its largest x.

        Raises:
            SimulationError: If the simulation diverges.
        """
        check_number("spacing", spacing, gt=0.0)
        cells = np.maximum(np.round(water.size / spacing).astype(int), 1)
        self.spacing = float(np.cbrt((water.size / cells).prod()))
        self.timestep = TIMESTEP * min(math.sqrt(self.spacing / SCALE), 1.0)
        points = _lattice(water, cells)
        columns = int(cells[0]), int(cells[1])
        self._water = Water(liquid, Resolution(len(points), self.spacing, columns))
        root = mjcf.RootElement(model="tank")
        root.option.gravity = [0.0, 0.0, -GRAVITY]
        root.option.timestep = self.timestep
        root.attach(self._water.mjcf_model)
        length, width, height = size
        tank = root.worldbody.add("body", name="tank", mocap=True)
        for box in (*_walls(length, width, height), *obstacles):
            _add(tank, box)
        bodies = [tank]
        if gate:
            bodies.append(root.worldbody.add("body", name="gate", mocap=True))
            x = water.high[0]
            _add(bodies[1], Box((x, -width, 0.0), (x + WALL, width, height)))
        self._water.confine(*bodies)
        physics = mjcf.Physics.from_mjcf_model(root)
        self._water.after_compile(physics, None)
        self._model, self._data = physics.model.ptr, physics.data.ptr
        self._physics = physics  # Owns model and data.
        self._water.set_points(points)
        mujoco.mj_forward(self._model, self._data)
        for _ in range(SETTLING):
            self.step()
            self._water.motion[3 * len(points) :] *= DAMPING

    @property
    def points(self) -> np.ndarray:
        """Positions of particles (n, 3) [m] relative to the tank."""
        return self._water.points() - self._data.mocap_pos[0]

    def remove_gate(self) -> None:
        """Removes the gate at once."""
        self._data.mocap_pos[1] = [0.0, 0.0, 1e3]
        self._water.set_points(self._water.points(), self._water.velocities())
        mujoco.mj_forward(self._model, self._data)

    def lift_gate(self, height: float) -> None:
        """Sets the height of the gate above its closed position [m] at the end of the next step."""
        self._data.mocap_pos[1, 2] = height

    def move(self, x: float) -> None:
        """Sets the tank's position along X [m] at the end of the next step."""
        self._data.mocap_pos[0, 0] = x

    def step(self) -> None:
        """Advances the water by a step.

        Raises:
            SimulationError: If the simulation diverges.
        """
        if not step(self._model, self._data):
            raise SimulationError("the water diverged")


def _lattice(water: Box, cells: np.ndarray) -> np.ndarray:
    """Returns the centers (n, 3) [m] of cells (3,) that fill a box evenly, with some noise."""
    sites = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    noise = NOISE * np.random.default_rng(0).uniform(-1.0, 1.0, sites.shape)
    return np.array(water.low) + (sites + 0.5 + noise) * (water.size / cells)


def _walls(length: float, width: float, height: float) -> tuple[Box, ...]:
    """Returns floor and sides around a space whose center in Y is 0."""
    y = width / 2.0
    w = WALL
    return (
        Box((-w, -y - w, -w), (length + w, y + w, 0.0)),
        Box((-w, -y - w, 0.0), (0.0, y + w, height)),
        Box((length, -y - w, 0.0), (length + w, y + w, height)),
        Box((0.0, -y - w, 0.0), (length, -y, height)),
        Box((0.0, y, 0.0), (length, y + w, height)),
    )


def _add(body: mjcf.Element, box: Box) -> None:
    body.add(
        "geom", type="box", pos=np.add(box.low, box.high) / 2.0, size=box.size / 2.0,
        contype=0, conaffinity=0,
    )  # fmt: skip


def front(points: np.ndarray, spacing: float, width: float) -> float:
    """Returns how far water of particles (n, 3) [m] has come along X [m].

    It is the median over lanes of one spacing across the tank: a single drop does not count.
    """
    lanes = max(round(width / spacing), 1)
    lane = np.clip(((points[:, 1] / width + 0.5) * lanes).astype(int), 0, lanes - 1)
    furthest = np.full(lanes, -np.inf)
    np.maximum.at(furthest, lane, points[:, 0])
    return float(np.median(furthest)) + spacing / 2.0


def depth(points: np.ndarray, spacing: float, x: float, width: float | None = None) -> float:
    """Returns the depth of water [m] at a gauge.

    Like the wetted length of a gauge, it is a volume over an area, without air between water.
    Weights of particles fall linearly to 0 over a whole number of spacings, so that the sum over a
    lattice does not depend on where it is.

    Args:
        points: Particles (n, 3) [m], each of spacing^3.
        spacing: [m].
        x: Position of the gauge along X [m]; it stands in the middle of the tank.
        width: Width of the tank [m] if the depth is averaged over it.
    """
    reach = spacing * max(round(GAUGE / spacing), 1)
    weights = np.maximum(1.0 - np.abs(points[:, 0] - x) / reach, 0.0)
    if width is None:
        weights *= np.maximum(1.0 - np.abs(points[:, 1]) / reach, 0.0)
        width = reach
    return float(weights.sum()) * spacing**3 / (reach * width)
