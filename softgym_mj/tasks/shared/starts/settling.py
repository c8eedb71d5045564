"""`Settling`: a flex alone on the floor, simulated until it is at rest.

The procedures are SoftGym's (facts 3.4 and 3.6) with its settle test made on the speed of every
vertex, where the original compares signed components and so may stop while things fall. They are
generators: who runs them simulates one flex with MuJoCo, or many together on a device.
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
MIN_SETTLE_STEPS = 10  # Sim steps: at release the speed passes through zero without being at rest.
_MOST_HELD = 2  # Vertices at a time.
_AWAY = (0.0, 0.0, 100.0)  # [m] Where what holds vertices touches nothing.

# Where held vertices are at the end of a sim step [m], by their numbers.
Held = Mapping[int, np.ndarray]
# Yields what is held in each sim step, is sent the points (n, 3) [m] after it, returns those at
# rest.
Procedure = Generator[Held, np.ndarray, np.ndarray]


class Settling:
    """What a procedure knows of its flex.

    Attributes:
        points: (n, 3) [m] now.
    """

    def __init__(self, points: np.ndarray):
        self.points = self._before = points

    def step(self, held: Held | None = None) -> Generator[Held, np.ndarray, None]:
        """One sim step."""
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
        """Sim steps until every vertex is slower than `SETTLED_SPEED`, at most `max_steps`."""
        for count in range(1, max_steps + 1):
            yield from self.step()
            if count >= MIN_SETTLE_STEPS and self.max_speed() < SETTLED_SPEED:
                return

    def speeds(self) -> np.ndarray:
        """Mean speed of every vertex (n,) [m/s] in the last sim step.

        The velocity at its end is that of the last substep, which in a pile at rest is some mm/s.
        """
        return np.linalg.norm(self.points - self._before, axis=1) / SIM_STEP

    def max_speed(self) -> float:
        """Speed of the fastest vertex [m/s]."""
        return float(self.speeds().max())


class SettledFlex(abc.ABC):
    """Start states of a flex that a procedure settles: see `variations.indices.Start`."""

    name: str

    @abc.abstractmethod
    def flex(self, index: int) -> Flex:
        """The flex of a variation."""

    @abc.abstractmethod
    def begin(self, index: int, flex: Flex) -> np.ndarray:
        """Where its vertices are at first (n, 3) [m]."""

    @abc.abstractmethod
    def procedure(self, index: int, flex: Flex, scene: Settling) -> Procedure:
        """Settles it from there."""

    def generate(self, index: int) -> np.ndarray:
        """Settled vertex positions (n, 3) [m].

        Raises:
            SimulationError: if it does not come to rest.
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
        """What `generate` makes of each (n, 3) [m], all together on a device.

        The same bits, as the simulation has them; what it has no room for is made alone.

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
    """What a procedure holds next, or where vertices are in the end."""
    try:
        return procedure.send(points)
    except StopIteration as stop:
        return stop.value


def _described(flex: Flex) -> np.ndarray:
    """What `ClothBatchSolver` have to know of a flex on the floor: bytes (size,)."""
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


def centred(vertices: np.ndarray) -> np.ndarray:
    """The vertices (n, 3) shifted so that their horizontal mean is the origin."""
    return vertices - [*vertices[:, :2].mean(axis=0), 0.0]
