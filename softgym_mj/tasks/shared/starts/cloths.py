"""Start states of the tasks on a cloth of random size: crumpled, flat or hanging."""

import dataclasses
from collections.abc import Generator
from typing import ClassVar

import numpy as np

from softgym_mj.entities.cloth import MAX_DIM, MIN_DIM, Cloth, grid_shape
from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.tasks.shared.starts.settling import (
    MIN_SETTLE_STEPS,
    SETTLED_SPEED,
    Held,
    Procedure,
    SettledFlex,
    Settling,
    centered,
)
from softgym_mj.variations.indices import generator

# Sides [particles] (upper end exclusive), lift height [m], sim steps of holding and falling.
SIZE_RANGE = (60, 120)
_LIFT_HEIGHT = (0.5, 1.0)
# [m/s] SoftGym teleports the vertex; 1 m/s is a picker's largest speed along an axis.
_LIFT_SPEED = 1.0
_HOLD_STEPS, _FALL_STEPS = 300, 300
_SLUMP_STEPS = 200  # Piles slump for another second or two; FleX freezes them.
# [m/s] A cloth is settled when its root mean square speed is below this: single vertices may
# tremble for long. A coarse cloth has so few vertices that these dominate the mean: if it goes on,
# the cloth is settled when its vertices move by less than `_TREMBLE` [m] in `_TREMBLE_STEPS` sim
# steps.
_SETTLED_RMS = 0.01
_MAX_STEPS = 2000
_TREMBLE, _TREMBLE_STEPS = 1e-3, 100

# Towel: length along X and width [particles] (upper ends exclusive), distance of its end from the
# given place and offset along Y [m], and rotation [rad].
_TOWEL_LENGTHS, _TOWEL_WIDTHS = (59, 82), (39, 56)
_TOWEL_GAP, _TOWEL_SHIFT, _TOWEL_ANGLE = (0.12, 0.17), 0.04, np.pi / 18

# [m] Hanging cloth: X, height of its lower edge, and the lowest upper edge.
_HANG_X, _HANG_BOTTOM, _LOWEST_TOP = (-0.1, 0.1), (0.1, 0.2), 0.5
_HANG_JITTER = 1e-3  # [m]
_MIN_HANG_STEPS, _HANG_STEPS = 300, 1000  # [sim steps] SoftGym always stops after 500.


@dataclasses.dataclass(frozen=True)
class _SizedCloth(SettledFlex):
    """Cloth of random size."""

    fidelity: str = "default"
    size_range: tuple[int, int] = SIZE_RANGE  # [particles] Sides; the upper end is exclusive.
    name: str = ""
    _version: ClassVar[int] = 2

    def __post_init__(self):
        low, high = self.size_range
        if not MIN_DIM <= low < high <= MAX_DIM + 1:
            valid = f"(low, high) with {MIN_DIM} <= low < high <= {MAX_DIM + 1} particles"
            raise InvalidArgumentError("sizes", self.size_range, valid)

    @property
    def parameters(self) -> dict[str, object]:
        cloth = Cloth(fidelity=self.fidelity).physical_parameters
        version, fidelity = self._version, self.fidelity
        return {"version": version, "fidelity": fidelity, "sizes": self.size_range, "cloth": cloth}

    @property
    def max_points(self) -> int:
        """Largest number of vertices in any variation."""
        rows, columns = grid_shape((self.size_range[1] - 1,) * 2, self.fidelity)
        return rows * columns

    def dims(self, index: int) -> tuple[int, int]:
        """Returns the size (dimx, dimy) of a variation in SoftGym particles."""
        dimx, dimy = generator(self.name, index).integers(*self.size_range, size=2)
        return int(dimx), int(dimy)

    def sizes(self, index: int) -> tuple[tuple[int, int]]:
        """Returns the sizes of the objects: the cloth's."""
        return (self.dims(index),)

    def flex(self, index: int) -> Cloth:
        return Cloth(dims=self.dims(index), fidelity=self.fidelity)


@dataclasses.dataclass(frozen=True)
class CrumpledCloth(_SizedCloth):
    """Cloth of random size, lifted at a random vertex and dropped (docs/softgym.md 3.6)."""

    name: str = "crumpled_cloth"
    _version: ClassVar[int] = 8

    def begin(self, index, flex):
        return flex.flat()

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Lifts and drops the cloth, and waits until it rests."""
        random = generator(self.name, index)
        random.integers(*self.size_range, size=2)  # `dims` draws these.
        yield from scene.step()
        # A place on the sheet is drawn, so that it is the same for every fidelity.
        place = random.uniform(size=2) * (np.array(flex.shape) - 1)
        vertex = flex.index(*np.round(place).astype(int).tolist())
        height = random.uniform(*_LIFT_HEIGHT)
        lift_steps = int(np.ceil(height / (_LIFT_SPEED * SIM_STEP)))
        yield from scene.drag(vertex, np.array([0.0, 0.0, height / lift_steps]), lift_steps)
        for count in range(_HOLD_STEPS):
            yield from scene.drag(vertex, np.zeros(3), 1)
            if count >= MIN_SETTLE_STEPS and scene.max_speed() < SETTLED_SPEED:
                break
        yield from scene.settle(_FALL_STEPS)
        for _ in range(_SLUMP_STEPS):
            yield from scene.step()
        steps = _FALL_STEPS + _SLUMP_STEPS
        while np.sqrt(np.mean(scene.speeds() ** 2)) >= _SETTLED_RMS:
            if steps >= _MAX_STEPS:
                yield from self._stay(index, scene)
                break
            yield from scene.step()
            steps += 1
        return centered(scene.points)

    def _stay(self, index: int, scene: Settling) -> Generator[Held, np.ndarray, None]:
        """Simulates until it is known that the vertices stay in place.

        Raises:
            SimulationError: if they do not.
        """
        before = scene.points
        for _ in range(_TREMBLE_STEPS):
            yield from scene.step()
        moves = np.linalg.norm(scene.points - before, axis=1)
        if np.sqrt(np.mean(moves**2)) >= _TREMBLE:
            raise SimulationError(
                f"variation {index} of {self.name} still moves after {_MAX_STEPS} sim steps: "
                f"{moves.max():.4f} m in {_TREMBLE_STEPS} of them"
            )


@dataclasses.dataclass(frozen=True)
class FlatCloth(_SizedCloth):
    """Flat cloth of random size, rotated about the vertical (docs/softgym.md 3.7)."""

    name: str = "flat_cloth"

    def angle(self, index: int) -> float:
        """Returns the rotation of the cloth about +Z [rad], within +-45 degrees."""
        return float(generator(f"{self.name}/angle", index).uniform(-np.pi / 4, np.pi / 4))

    def begin(self, index, flex):
        return flex.flat(angle=self.angle(index))

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Waits until the cloth rests."""
        yield from scene.settle(_FALL_STEPS)
        return centered(scene.points)


@dataclasses.dataclass(frozen=True)
class FlatTowel(FlatCloth):
    """Flat towel that ends shortly before a place along X, rotated a little about the vertical.

    Attributes:
        end_x: X of this place [m].
    """

    size_range: tuple[int, int] = (_TOWEL_WIDTHS[0], _TOWEL_LENGTHS[1])
    name: str = "flat_towel"
    end_x: float = 0.0

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters that determine the states, the given place among them."""
        return {**super().parameters, "end_x": self.end_x}

    def dims(self, index: int) -> tuple[int, int]:
        random = generator(self.name, index)
        return int(random.integers(*_TOWEL_LENGTHS)), int(random.integers(*_TOWEL_WIDTHS))

    def angle(self, index: int) -> float:
        return float(generator(f"{self.name}/angle", index).uniform(-_TOWEL_ANGLE, _TOWEL_ANGLE))

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Waits until the towel rests, and moves it to its place."""
        points = yield from super().procedure(index, flex, scene)
        random = generator(f"{self.name}/place", index)
        end, y = self.end_x - random.uniform(*_TOWEL_GAP), random.uniform(-1.0, 1.0) * _TOWEL_SHIFT
        return points + [end - points[:, 0].max(), y, 0.0]


@dataclasses.dataclass(frozen=True)
class HangingCloth(_SizedCloth):
    """Cloth of random size hanging by the two corners of column 0 (docs/softgym.md 3.9)."""

    name: str = "hanging_cloth"

    def sheet(self, index: int) -> np.ndarray:
        """Returns vertices (rows * columns, 3) [m] of the sheet before it sags, column 0 on top."""
        cloth = Cloth(dims=self.dims(index), fidelity=self.fidelity)
        random = generator(f"{self.name}/place", index)
        x, bottom = random.uniform(*_HANG_X), random.uniform(*_HANG_BOTTOM)
        width, _ = cloth.size
        top = max(bottom + width, _LOWEST_TOP)
        along, across, _ = cloth.flat().T
        vertices = np.column_stack([np.full_like(along, x), across, top - width / 2 - along])
        # SoftGym's jitter: without it the sheet would stay in its plane.
        vertices[0] += random.uniform(0.0, _HANG_JITTER)
        return vertices

    def begin(self, index, flex):
        return self.sheet(index)

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Holds the two corners and waits until the cloth rests."""
        goals = {vertex: scene.points[vertex] for vertex in flex.corners[:2].tolist()}
        for count in range(_HANG_STEPS):
            yield from scene.step(goals)
            if count >= _MIN_HANG_STEPS and scene.max_speed() < SETTLED_SPEED:
                break
        return scene.points
