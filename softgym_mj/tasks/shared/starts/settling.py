"""`Settling`: a flex alone on the floor, simulated until it rests.

The procedures are SoftGym's (docs/softgym.md 3.4 and 3.6), but their settle test uses the speed of
every vertex. The original compares signed velocity components, so it may stop while things fall.
Procedures are generators: the caller simulates one flex with MuJoCo, or many side by side on a
device.
"""

import abc
from collections.abc import Generator, Mapping, Sequence

import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.cloth.batch_solver import NOT_FINITE, ClothBatchSolver, describe
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.flex import GRIPPER_CONTACT, Flex
from softgym_mj.exceptions import SimulationError
from softgym_mj.robots.base import SIM_STEP

SETTLED_SPEED = 0.01  # [m/s] SoftGym's threshold for ropes and piles at rest.
MIN_SETTLE_STEPS = 10  # [sim steps] At release the speed passes through zero without rest.
_MOST_HELD = 2  # Largest number of held vertices.
_AWAY = (0.0, 0.0, 100.0)  # [m] Place of the geoms that hold vertices, out of contact.

# Held vertices: index -> position at the end of a sim step [m].
Held = Mapping[int, np.ndarray]
# Yields the held vertices of each sim step, is sent the points (n, 3) [m] after it and returns the
# points at rest.
Procedure = Generator[Held, np.ndarray, np.ndarray]


class Settling:
    """State of the flex that a procedure settles.

    Attributes:
        points: current points (n, 3) [m].
    """

    def __init__(self, points: np.ndarray):
        self.points = self._before = points

    def step(self, held: Held | None = None) -> Generator[Held, np.ndarray, None]:
        """Simulates one sim step."""
        points = yield held or {}
        self._before, self.points = self.points, points

    def drag(
        self, vertex: int, displacement: np.ndarray, steps: int
    ) -> Generator[Held, np.ndarray, None]:
        """Moves a held vertex by `displacement` (3,) [m] in each of `steps` sim steps."""
        goal = self.points[vertex]
        for _ in range(steps):
            goal = goal + displacement
            yield from self.step({vertex: goal})

    def settle(self, max_steps: int) -> Generator[Held, np.ndarray, None]:
        """Simulates until every vertex is slower than `SETTLED_SPEED`, at most `max_steps`."""
        for count in range(1, max_steps + 1):
            yield from self.step()
            if count >= MIN_SETTLE_STEPS and self.max_speed() < SETTLED_SPEED:
                return

    def speeds(self) -> np.ndarray:
        """Returns the mean speed of every vertex (n,) [m/s] in the last sim step.

        The velocity at its end is that of the last substep, which is some mm/s in a pile at rest.
        """
        return np.linalg.norm(self.points - self._before, axis=1) / SIM_STEP

    def max_speed(self) -> float:
        """Returns the speed of the fastest vertex [m/s]."""
        return float(self.speeds().max())


class SettledFlex(abc.ABC):
    """Start states of a flex that a procedure settles; implements `variations.indices.Start`."""

    name: str

    @abc.abstractmethod
    def flex(self, index: int) -> Flex:
        """Returns the flex of a variation."""

    @abc.abstractmethod
    def begin(self, index: int, flex: Flex) -> np.ndarray:
        """Returns its initial vertices (n, 3) [m]."""

    @abc.abstractmethod
    def procedure(self, index: int, flex: Flex, scene: Settling) -> Procedure:
        """Settles the flex from its initial vertices."""

    def generate(self, index: int) -> np.ndarray:
        """Returns settled vertices (n, 3) [m].

        Raises:
            SimulationError: if the flex does not come to rest.
        """
        flex = self.flex(index)
        arena = Arena()
        arena.attach(flex)
        physics = arena.compile(flex.timestep, flex)
        flex.set_points(self.begin(index, flex))
        procedure = self.procedure(index, flex, Settling(flex.points()))
        now: set[int] = set()
        answer: Held | np.ndarray = next(procedure)
        while isinstance(answer, Mapping):
            for vertex in now - answer.keys():
                flex.release(vertex)
            for vertex in answer.keys() - now:
                flex.hold(vertex)
            for vertex, goal in answer.items():
                flex.drive(vertex, goal, SIM_STEP)
            now = set(answer)
            with physics.check_invalid_state():
                mujoco.mj_step(physics.model.ptr, physics.data.ptr)
            answer = _answer(procedure, flex.points())
        return answer

    def generate_all(self, indices: Sequence[int], device: Device) -> list[np.ndarray]:
        """Returns settled vertices (n, 3) [m] of several variations, simulated on a device.

        They are bit-identical to those of `generate`, which is called for flexes that exceed the
        capacity of the device's solver.

        Raises:
            SimulationError: if one does not come to rest, or diverges.
        """
        flexes = [self.flex(index) for index in indices]
        most = max(flex.num_points for flex in flexes)
        solver = ClothBatchSolver(len(indices), most, _MOST_HELD, device)
        procedures: dict[int, Procedure] = {}
        held: dict[int, Held] = {}
        found: dict[int, np.ndarray] = {}
        for i, (index, flex) in enumerate(zip(indices, flexes, strict=True)):
            solver.start(i, _described(flex))
            flex.set_points(self.begin(index, flex))
            solver.set_state(i, {"qpos": device.put(flex.slides)})
            procedures[i] = self.procedure(index, flex, Settling(flex.points()))
            held[i] = next(procedures[i])
        away = np.tile(_AWAY, (len(indices), _MOST_HELD, 1))
        solver.gripper_qpos[...] = device.put(away)
        while held:
            which = np.full((len(indices), _MOST_HELD), -1, np.int32)
            goals = np.zeros((len(indices), _MOST_HELD, 3))
            for i, own in held.items():
                for k, (vertex, goal) in enumerate(own.items()):
                    which[i, k], goals[i, k] = vertex, goal
            solver.step(*map(device.put, (away, which, goals)))
            moved, flags = device.get(solver.qpos), device.get(solver.flags)
            for i in list(held):
                if flags[i] & NOT_FINITE:
                    raise SimulationError(f"variation {indices[i]} of {self.name} has diverged")
                points = flexes[i].origin + moved[i, : flexes[i].num_points]
                answer = self.generate(indices[i]) if flags[i] else _answer(procedures[i], points)
                if isinstance(answer, Mapping):
                    held[i] = answer
                else:
                    found[i] = answer
                    del held[i]
                    solver.models[i] = 0
        return [found[i] for i in range(len(indices))]


def _answer(procedure: Procedure, points: np.ndarray) -> Held | np.ndarray:
    """Returns the held vertices of the next sim step, or the final points."""
    try:
        return procedure.send(points)
    except StopIteration as stop:
        return stop.value


def _described(flex: Flex) -> np.ndarray:
    """Returns the `ClothBatchSolver` description (size,) uint8 of a flex on the floor."""
    arena = Arena()
    arena.attach(flex)
    for k in range(_MOST_HELD):
        arena.mjcf_model.worldbody.add(
            "geom", name=f"holds_{k}", type="sphere", size=[0.01], pos=_AWAY,
            contype=GRIPPER_CONTACT, conaffinity=0,
        )  # fmt: skip
    physics = arena.compile(flex.timestep, flex)
    model = physics.model.ptr
    return describe(model, [model.geom(f"holds_{k}").id for k in range(_MOST_HELD)])


def centered(vertices: np.ndarray) -> np.ndarray:
    """Returns the vertices (n, 3) shifted so that their horizontal mean is the origin."""
    return vertices - [*vertices[:, :2].mean(axis=0), 0.0]
