"""Initializers: how the settled initial states of the variations come about by simulation.

Each is the procedure of SoftGym (facts 3.4 and 3.6) with its settle test made on the speed of
every vertex, where the original compares signed components and so may stop while things fall.
"""

import dataclasses
from typing import ClassVar

import mujoco
import numpy as np

from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.flex import Flex
from softgym_mj.entities.rope import Rope
from softgym_mj.exceptions import SimulationError
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.variations.indices import generator

SETTLED_SPEED = 0.01  # [m/s] SoftGym's threshold for ropes and heaps at rest.
_MIN_SETTLE_STEPS = 10  # Sim steps: at release the speed passes through zero without being at rest.

_PLACES = 41  # Where the rope may be taken, evenly spaced.
# Rope: displacement of the dragged vertex per sim step [m] and its duration in sim steps.
_DRAG_DISPLACEMENT, _DRAG_STEPS, _DRAG_REPEATS = 0.005, 60, 4
_ROPE_SETTLE_STEPS, _ROPE_FINAL_STEPS = 100, 500
_ROPE_MAX_STEPS = 3000  # SoftGym saves whatever moves after its 500; we go on until it rests.

# Cloth: sizes in particles (upper end exclusive), lift height [m], sim steps held and falling.
SIZE_RANGE = (60, 120)
_LIFT_HEIGHT = (0.5, 1.0)
_LIFT_SPEED = 1.0  # [m/s]. SoftGym teleports the vertex; 1 m/s is the fastest picker.
_HOLD_STEPS, _FALL_STEPS = 300, 300
_SLUMP_STEPS = 200  # A heap goes on slumping for a second or two where FleX freezes it.
# It counts as settled when its root mean square speed is below this [m/s]: single vertices may
# tremble for long.
_CLOTH_SETTLED_RMS = 0.01
_CLOTH_MAX_STEPS = 2000

# Hanging cloth: place and height of its lower edge, and the lowest upper edge [m].
_HANG_X, _HANG_BOTTOM, _LOWEST_TOP = (-0.1, 0.1), (0.1, 0.2), 0.5
_HANG_JITTER = 1e-3  # [m]
_MIN_HANG_STEPS, _HANG_STEPS = 300, 1000  # Sim steps; SoftGym stops after 500 whatever moves.


class _Scene:
    """A flex alone on the floor, stepped by sim steps."""

    def __init__(self, flex: Flex):
        arena = Arena(camera="cloth")
        arena.attach(flex)
        self._physics = arena.compile(flex.timestep, flex)
        self._flex = flex
        self._before = flex.vertices()

    def step(self) -> None:
        """One sim step; divergence is an error."""
        self._before = self._flex.vertices()
        with self._physics.check_invalid_state():
            mujoco.mj_step(self._physics.model.ptr, self._physics.data.ptr)

    def drag(self, vertex: int, displacement: np.ndarray, steps: int) -> None:
        """Moves a held vertex by `displacement` (3,) [m] in each of `steps` sim steps."""
        goal = self._flex.vertex(vertex)
        for _ in range(steps):
            goal = goal + displacement
            self._flex.drive(vertex, goal, SIM_STEP)
            self.step()

    def settle(self, max_steps: int) -> None:
        """Sim steps until every vertex is slower than `SETTLED_SPEED`, at most `max_steps`."""
        for count in range(1, max_steps + 1):
            self.step()
            if count >= _MIN_SETTLE_STEPS and self.max_speed() < SETTLED_SPEED:
                return

    def speeds(self) -> np.ndarray:
        """Mean speed of every vertex [m/s] in the last sim step.

        The velocity at its end is that of the last substep, which in a heap at rest is some mm/s.
        """
        return np.linalg.norm(self._flex.vertices() - self._before, axis=1) / SIM_STEP

    def max_speed(self) -> float:
        """Speed of the fastest vertex [m/s]."""
        return float(self.speeds().max())


def _centred(vertices: np.ndarray) -> np.ndarray:
    """The vertices (n, 3) shifted so that their horizontal mean is the origin."""
    return vertices - [*vertices[:, :2].mean(axis=0), 0.0]


@dataclasses.dataclass(frozen=True)
class TwistedRope:
    """A rope dragged by a random vertex four times and left to settle (facts 3.4)."""

    fidelity: str = "default"
    name: str = "twisted_rope"

    @property
    def parameters(self) -> dict[str, object]:
        """What the states depend on."""
        rope = Rope(self.fidelity).physical_parameters
        return {"version": 3, "fidelity": self.fidelity, "rope": rope}

    def generate(self, index: int) -> np.ndarray:
        """Settled vertex positions (n, 3) [m]."""
        random = generator(self.name, index)
        rope = Rope(self.fidelity)
        scene = _Scene(rope)
        rope.set_vertices(rope.straight())
        for repeat in range(_DRAG_REPEATS):
            # Drawn among the default rope's: the same place for every fidelity.
            place = int(random.integers(_PLACES)) / (_PLACES - 1)
            vertex = round(place * (rope.num_vertices - 1))
            direction = random.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0])
            rope.hold(vertex)
            scene.drag(vertex, _DRAG_DISPLACEMENT * direction, _DRAG_STEPS)
            rope.release(vertex)
            last = repeat == _DRAG_REPEATS - 1
            scene.settle(_ROPE_SETTLE_STEPS + (_ROPE_FINAL_STEPS if last else 0))
        if scene.max_speed() >= SETTLED_SPEED:
            scene.settle(_ROPE_MAX_STEPS)
        if scene.max_speed() >= SETTLED_SPEED:
            raise SimulationError(
                f"variation {index} of {self.name} still moves at {scene.max_speed():.3f} m/s "
                f"after {_ROPE_MAX_STEPS} sim steps"
            )
        return _centred(rope.vertices())


@dataclasses.dataclass(frozen=True)
class _SizedCloth:
    """What the cloths of random size share."""

    fidelity: str = "default"
    sizes: tuple[int, int] = SIZE_RANGE  # Of the sides [particles], the upper end exclusive.
    name: str = ""
    _version: ClassVar[int] = 2

    @property
    def parameters(self) -> dict[str, object]:
        cloth = Cloth(fidelity=self.fidelity).physical_parameters
        version, fidelity = self._version, self.fidelity
        return {"version": version, "fidelity": fidelity, "sizes": self.sizes, "cloth": cloth}

    @property
    def largest(self) -> int:
        return self.sizes[1] - 1

    def dims(self, index: int) -> tuple[int, int]:
        """Size (dimx, dimy) of a variation in SoftGym particles."""
        dimx, dimy = generator(self.name, index).integers(*self.sizes, size=2)
        return int(dimx), int(dimy)


@dataclasses.dataclass(frozen=True)
class CrumpledCloth(_SizedCloth):
    """A cloth of random size lifted at a random vertex and dropped (facts 3.6)."""

    name: str = "crumpled_cloth"
    _version: ClassVar[int] = 7

    def generate(self, index: int) -> np.ndarray:
        """Settled vertex positions (rows * columns, 3) [m]."""
        random = generator(self.name, index)
        random.integers(*self.sizes, size=2)  # Drawn in `dims`.
        cloth = Cloth(dims=self.dims(index), fidelity=self.fidelity)
        scene = _Scene(cloth)
        cloth.set_vertices(cloth.flat())
        scene.step()
        # Drawn as a place on the sheet: the same for every fidelity.
        place = random.uniform(size=2) * (np.array(cloth.shape) - 1)
        vertex = cloth.index(*np.round(place).astype(int).tolist())
        height = random.uniform(*_LIFT_HEIGHT)
        lift_steps = int(np.ceil(height / (_LIFT_SPEED * SIM_STEP)))
        cloth.hold(vertex)
        scene.drag(vertex, np.array([0.0, 0.0, height / lift_steps]), lift_steps)
        for count in range(_HOLD_STEPS):
            scene.drag(vertex, np.zeros(3), 1)
            if count >= _MIN_SETTLE_STEPS and scene.max_speed() < SETTLED_SPEED:
                break
        cloth.release(vertex)
        scene.settle(_FALL_STEPS)
        for _ in range(_SLUMP_STEPS):
            scene.step()
        steps = _FALL_STEPS + _SLUMP_STEPS
        while np.sqrt(np.mean(scene.speeds() ** 2)) >= _CLOTH_SETTLED_RMS:
            if steps >= _CLOTH_MAX_STEPS:
                raise SimulationError(
                    f"variation {index} of {self.name} still moves at {scene.max_speed():.3f} m/s "
                    f"after {steps} sim steps"
                )
            scene.step()
            steps += 1
        return _centred(cloth.vertices())


@dataclasses.dataclass(frozen=True)
class FlatCloth(_SizedCloth):
    """A cloth of random size that lies flat, turned about the vertical (facts 3.7)."""

    name: str = "flat_cloth"

    def angle(self, index: int) -> float:
        """By how much the cloth is turned about +Z [rad], within +-45 degrees."""
        return float(generator(f"{self.name}/angle", index).uniform(-np.pi / 4, np.pi / 4))

    def generate(self, index: int) -> np.ndarray:
        """Vertex positions (rows * columns, 3) [m], at rest on the floor."""
        cloth = Cloth(dims=self.dims(index), fidelity=self.fidelity)
        scene = _Scene(cloth)
        cloth.set_vertices(cloth.flat(angle=self.angle(index)))
        scene.settle(_FALL_STEPS)
        return _centred(cloth.vertices())


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

    def generate(self, index: int) -> np.ndarray:
        """Settled vertex positions (rows * columns, 3) [m]."""
        cloth = Cloth(dims=self.dims(index), fidelity=self.fidelity)
        scene = _Scene(cloth)
        cloth.set_vertices(self.sheet(index))
        held = cloth.corners[:2].tolist()
        goals = {vertex: cloth.vertex(vertex) for vertex in held}
        for vertex in held:
            cloth.hold(vertex)
        for count in range(_HANG_STEPS):
            for vertex, goal in goals.items():
                cloth.drive(vertex, goal, SIM_STEP)
            scene.step()
            if count >= _MIN_HANG_STEPS and scene.max_speed() < SETTLED_SPEED:
                break
        cloth.release_all()
        return cloth.vertices()
