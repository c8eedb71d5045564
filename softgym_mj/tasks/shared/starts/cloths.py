"""The start states of the tasks on a cloth of random size: crumpled, flat or hanging."""

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
    centred,
)
from softgym_mj.variations.indices import generator

# Sizes in particles (upper end exclusive), lift height [m], sim steps held and falling.
SIZE_RANGE = (60, 120)
_LIFT_HEIGHT = (0.5, 1.0)
_LIFT_SPEED = 1.0  # [m/s]. SoftGym teleports the vertex; 1 m/s is the fastest picker.
_HOLD_STEPS, _FALL_STEPS = 300, 300
_SLUMP_STEPS = 200  # A pile goes on slumping for a second or two where FleX freezes it.
# It counts as settled when its root mean square speed is below this [m/s]: single vertices may
# tremble for long. Of a coarse cloth so few are not much less than all: where that goes on, it
# counts as settled when it stays where it is, its vertices within so much [m] in so many sim steps.
_SETTLED_RMS = 0.01
_MAX_STEPS = 2000
_TREMBLE, _TREMBLE_STEPS = 1e-3, 100

# Hanging cloth: place and height of its lower edge, and the lowest upper edge [m].
_HANG_X, _HANG_BOTTOM, _LOWEST_TOP = (-0.1, 0.1), (0.1, 0.2), 0.5
_HANG_JITTER = 1e-3  # [m]
_MIN_HANG_STEPS, _HANG_STEPS = 300, 1000  # Sim steps; SoftGym stops after 500 whatever moves.


@dataclasses.dataclass(frozen=True)
class _SizedCloth(SettledFlex):
    """What the cloths of random size share."""

    fidelity: str = "default"
    size_range: tuple[int, int] = SIZE_RANGE  # Of the sides [particles], the upper end exclusive.
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
        """Most vertices of any variation."""
        rows, columns = grid_shape((self.size_range[1] - 1,) * 2, self.fidelity)
        return rows * columns

    def dims(self, index: int) -> tuple[int, int]:
        """Size (dimx, dimy) of a variation in SoftGym particles."""
        dimx, dimy = generator(self.name, index).integers(*self.size_range, size=2)
        return int(dimx), int(dimy)

    def sizes(self, index: int) -> tuple[tuple[int, int]]:
        """Of the cloth."""
        return (self.dims(index),)

    def flex(self, index: int) -> Cloth:
        """The cloth of a variation."""
        return Cloth(dims=self.dims(index), fidelity=self.fidelity)


@dataclasses.dataclass(frozen=True)
class CrumpledCloth(_SizedCloth):
    """A cloth of random size lifted at a random vertex and dropped (facts 3.6)."""

    name: str = "crumpled_cloth"
    _version: ClassVar[int] = 8

    def begin(self, index, flex):
        return flex.flat()

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Lifts and drops the cloth, and waits."""
        random = generator(self.name, index)
        random.integers(*self.size_range, size=2)  # Drawn in `dims`.
        yield from scene.step()
        # Drawn as a place on the sheet: the same for every fidelity.
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
        return centred(scene.points)

    def _stay(self, index: int, scene: Settling) -> Generator[Held, np.ndarray, None]:
        """Sim steps in which it stays where it is.

        Raises:
            SimulationError: if it does not.
        """
        before = scene.points
        for _ in range(_TREMBLE_STEPS):
            yield from scene.step()
        ways = np.linalg.norm(scene.points - before, axis=1)
        if np.sqrt(np.mean(ways**2)) >= _TREMBLE:
            raise SimulationError(
                f"variation {index} of {self.name} still moves after {_MAX_STEPS} sim steps: "
                f"{ways.max():.4f} m in {_TREMBLE_STEPS} of them"
            )


@dataclasses.dataclass(frozen=True)
class FlatCloth(_SizedCloth):
    """A cloth of random size that lies flat, turned about the vertical (facts 3.7)."""

    name: str = "flat_cloth"

    def angle(self, index: int) -> float:
        """By how much the cloth is turned about +Z [rad], within +-45 degrees."""
        return float(generator(f"{self.name}/angle", index).uniform(-np.pi / 4, np.pi / 4))

    def begin(self, index, flex):
        return flex.flat(angle=self.angle(index))

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Waits until it lies."""
        yield from scene.settle(_FALL_STEPS)
        return centred(scene.points)


@dataclasses.dataclass(frozen=True)
class HangingCloth(_SizedCloth):
    """A cloth of random size that hangs by the two corners of its column 0 (facts 3.9)."""

    name: str = "hanging_cloth"

    def sheet(self, index: int) -> np.ndarray:
        """Vertex positions (rows * columns, 3) [m] of the sheet before it sags, column 0 on top."""
        cloth = Cloth(dims=self.dims(index), fidelity=self.fidelity)
        random = generator(f"{self.name}/place", index)
        x, bottom = random.uniform(*_HANG_X), random.uniform(*_HANG_BOTTOM)
        width, _ = cloth.size
        top = max(bottom + width, _LOWEST_TOP)
        along, across, _ = cloth.flat().T
        vertices = np.column_stack([np.full_like(along, x), across, top - width / 2 - along])
        # SoftGym's jitter: the sheet must not stay in its plane for ever.
        vertices[0] += random.uniform(0.0, _HANG_JITTER)
        return vertices

    def begin(self, index, flex):
        return self.sheet(index)

    def procedure(self, index: int, flex: Cloth, scene: Settling) -> Procedure:
        """Holds its corners, and waits."""
        goals = {vertex: scene.points[vertex] for vertex in flex.corners[:2].tolist()}
        for count in range(_HANG_STEPS):
            yield from scene.step(goals)
            if count >= _MIN_HANG_STEPS and scene.max_speed() < SETTLED_SPEED:
                break
        return scene.points
