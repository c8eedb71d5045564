"""What is done to the sheet: the rags' two primitives, and picking and placing a vertex."""

import dataclasses
import functools
import time

import numpy as np

from benchmarks.engines import ours
from benchmarks.engines.sheets import FABRIC, SHEET, SIDE, SPACING, STEP, Engine, Simulation, down
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality import primitives
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.recorder import Recorder, Replay
from softgym_mj.reality.replay import Hold

TABLE = 0.2  # [m] Height of the rags' table in the primitives' frame.
HANG, TOGETHER, WAIT = 0.5, 1.0, 0.5  # [s] Before a primitive.

SETTLE = 0.4  # [s] Before a vertex is picked.
LIFT, CARRY, LOWER, REST = 0.4, 0.8, 0.4, 1.0  # [s]
HEIGHT, PLACED = 0.15, 0.02  # [m] Of the vertex, carried and let go of.
ACTIONS = 10
WAYS = (0.1, 0.3)  # [m] How far a vertex is carried.
STATES = ("flat", "folded")


@dataclasses.dataclass(frozen=True)
class Motion:
    """A case of the study.

    Attributes:
        start: vertices (n, 3) [m] at its beginning.
        begin: when that is [s].
        holds: of vertices.
        moments: when the sheet is looked at [s], by name, in order.
    """

    start: np.ndarray
    begin: float
    holds: tuple[Hold, ...]
    moments: dict[str, float]


def names() -> list[str]:
    """All cases: "dynamic", "quasi_static", "flat 0", "folded 0", "flat 1", ..."""
    placed = [f"{state} {action}" for action in range(ACTIONS) for state in STATES]
    return [*primitives.PIECES, *placed]


def motion(name: str, mesh: Mesh, every: int = 1) -> Motion:
    """A case by its name.

    Args:
        name: of `names`.
        mesh: the sheet at rest.
        every: how many of its cells make one of `SHEET`: vertices are picked of that.
    """
    if name in primitives.PIECES:
        return rag(name, mesh, every)
    state, action = name.split()
    return pick_and_place(state, int(action), mesh, every)


def coarse(every: int) -> np.ndarray:
    """The vertices (`SIDE`^2,) of a mesh with `every` cells in one of `SHEET` that `SHEET` has."""
    side = (SIDE - 1) * every + 1
    return np.arange(side * side).reshape(side, side)[::every, ::every].ravel()


def rag(primitive: str, mesh: Mesh, every: int = 1) -> Motion:
    """A primitive of the rags: the sheet hangs from two corners, which come together, then go."""
    corners = coarse(every)[[0, SIDE - 1]]
    middle = sum(primitives.GRIPPER_X) / 2
    y, z = primitives.START
    wide = (SIDE - 1) * SPACING
    start = np.column_stack(
        [
            mesh.points[:, 0] + middle,
            np.full(len(mesh.points), y),
            z - TABLE + mesh.points[:, 1] - wide / 2,
        ]
    )

    def path(times: np.ndarray) -> np.ndarray:
        positions = primitives.gripper_positions(primitive, times) - [0.0, 0.0, TABLE]
        nearer = (wide - (primitives.GRIPPER_X[1] - primitives.GRIPPER_X[0])) / 2
        apart = np.interp(times, [-(TOGETHER + WAIT), -WAIT], [nearer, 0.0])
        return positions + apart[:, None, None] * np.array([[-1.0, 0, 0], [1.0, 0, 0]])

    ends = {
        "dynamic": {"hung": 0.0, "back": 1.1, "forth": 2.6, "lowered": 3.9, "end": 4.4},
        "quasi_static": {"hung": 0.0, "lower": 2.0, "on the table": 8.0, "dragged": 14.0},
    }
    hold = Hold(tuple(corners.tolist()), path)
    return Motion(start, -(HANG + TOGETHER + WAIT), (hold,), ends[primitive])


def smooth(share: np.ndarray) -> np.ndarray:
    """Minimum jerk: from 0 to 1 as its argument does, at rest at both ends."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def picks() -> list[tuple[int, np.ndarray]]:
    """Vertex of `SHEET` and way (2,) [m] of each action: any vertex of what is on top, any way."""
    random = np.random.default_rng(0)
    found = []
    for _ in range(ACTIONS):
        row, column = random.integers(SIDE), random.integers(SIDE // 2, SIDE)
        angle, length = random.uniform(0.0, 2.0 * np.pi), random.uniform(*WAYS)
        way = length * np.array([np.cos(angle), np.sin(angle)])
        found.append((int(row * SIDE + column), way))
    return found


def pick_and_place(state: str, action: int, mesh: Mesh, every: int = 1) -> Motion:
    """A vertex is lifted, carried along a straight way, lowered and let go of."""
    start = lying(mesh) if state == "flat" else folded(every)
    picked, way = picks()[action]
    vertex = int(coarse(every)[picked])
    place = start[vertex]
    low = np.array([place[2], HEIGHT, PLACED])

    def path(times: np.ndarray) -> np.ndarray:
        along = smooth((times - LIFT) / CARRY)[:, None] * way
        up = smooth(times / LIFT) * (low[1] - low[0])
        down_ = smooth((times - LIFT - CARRY) / LOWER) * (low[2] - low[1])
        return np.column_stack([place[:2] + along, low[0] + up + down_])[:, None]

    placed = LIFT + CARRY + LOWER
    ends = {"start": 0.0, "lift": LIFT, "carry": LIFT + CARRY, "place": placed}
    # By the path the picked vertex stays where the sheet starts; it is held from there on.
    return Motion(
        start, -SETTLE, (Hold((vertex,), path, 0.0, placed, follows=True),),
        {**ends, "release": placed + REST},
    )  # fmt: skip


def lying(mesh: Mesh) -> np.ndarray:
    """The sheet (n, 3) [m], flat on the floor."""
    return mesh.points + [0.0, 0.0, FABRIC.thickness / 2]


@functools.cache
def folded(every: int = 1) -> np.ndarray:
    """The sheet (n, 3) [m], its half at +X folded upon the other one, as it comes to rest in ours.

    All engines start with the same vertices; a finer mesh with points between them.
    """
    start = lying(SHEET).reshape(SIDE, SIDE, 3)
    half, gap = SIDE // 2, FABRIC.thickness
    # The cell in the bend is 3 cm long and rises by the layers' distance; the rest lies flat.
    rise = 1.2 * gap
    bend = start[0, half - 1, 0] + np.sqrt(SPACING**2 - rise**2)
    start[:, half:, 0] = bend - SPACING * np.arange(SIDE - half)
    start[:, half:, 2] += rise
    simulation = ours.engine().build(SHEET, FABRIC, start.reshape(-1, 3), down(), True)
    for _ in range(200):
        simulation.step(np.zeros((0, 3)))
    return refined(simulation.positions(), every)


def refined(points: np.ndarray, every: int) -> np.ndarray:
    """Vertices (SIDE^2, 3) of a grid as those of one with so many times as many cells."""
    grid = points.reshape(SIDE, SIDE, 3)
    places = np.arange((SIDE - 1) * every + 1) / every
    first = np.minimum(places.astype(int), SIDE - 2)
    share = places - first
    for axis in (0, 1):
        shape = [1, 1, 1]
        shape[axis] = -1
        s = share.reshape(shape)
        grid = (1.0 - s) * grid.take(first, axis) + s * grid.take(first + 1, axis)
    return grid.reshape(-1, 3)


def play(engine: Engine, mesh: Mesh, fabric: Fabric, motion: Motion) -> Replay:
    """What a sheet does in an engine, at the moments of a motion."""
    simulation = engine.build(mesh, fabric, motion.start, down(), True)
    try:
        return _played(simulation, mesh, motion)
    finally:
        simulation.close()


def _played(simulation: Simulation, mesh: Mesh, motion: Motion) -> Replay:
    moments = np.array(list(motion.moments.values()))
    recorder = Recorder(mesh, moments)
    recorder.start(motion.begin, motion.start)
    held: tuple[Hold, ...] = ()
    shifts: list[np.ndarray] = []
    simulation.hold(np.zeros(0, int))
    for count in range(round((moments[-1] - motion.begin) / STEP)):
        now = motion.begin + STEP * count
        active = tuple(h for h in motion.holds if h.begin <= now + STEP / 2 < h.end)
        if active != held:
            held = active
            vertices = np.array([v for hold in held for v in hold.vertices], int)
            simulation.hold(vertices)
            places = simulation.positions()
            # One that follows keeps its distance from its path.
            shifts = [
                places[list(h.vertices)] - h.path(np.array([now]))[0] if h.follows else np.zeros(3)
                for h in held
            ]
        end = np.array([now + STEP])
        targets = [h.path(end)[0] + shift for h, shift in zip(held, shifts, strict=True)]
        before = time.thread_time()
        simulation.step(np.concatenate(targets) if targets else np.zeros((0, 3)))
        took = 1e3 * (time.thread_time() - before)
        if not recorder.add(now + STEP, simulation.positions(), took):
            break
    return recorder.replay()
