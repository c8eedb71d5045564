"""A sheet whose held vertices go where hands went: what a recording of real cloth is compared with.

    mesh = rectangle(0.6, 0.6, 0.03)
    hold = Hold((0, 20), lambda times: np.array(...))  # (n,) [s] to (n, 2, 3) [m].
    replay(mesh, Fabric.named("black_denim"), [hold], times=np.arange(0.0, 4.4, 1 / 30))

What it did is a `Replay`.
"""

import dataclasses
import math
import time
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth import fabrics, solver
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError, check_number
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.recorder import Recorder, Replay
from softgym_mj.reality.sheets import BareSheet

REACH = 0.05  # [m] From which a held vertex may start beside its way.
# [bytes] That a step may take, of vertices and of pairs of them, which MuJoCo looks at as bodies;
# its default is too little for thousands of vertices.
_MEMORY_OF_VERTEX, _MEMORY_OF_PAIR, _LEAST_MEMORY = 2**14, 3, 2**24
_FLOOR_SIZE = 10.0  # [m] Of what is drawn; it has no end.
_ROUNDING = 1e-9  # [s]
# MuJoCo starts anew when numbers are bad, and says so.
_BAD = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)

Path = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Hold:
    """Vertices that go where they are told to while they are held.

    Attributes:
        vertices: (k,) indices.
        path: where they are (n, k, 3) [m] at times (n,) [s].
        begin, end: when they are held [s]; afterwards they are let go of.
        follows: whether vertices keep their distances from the path, as when it is that of a hand
            which holds them; else they are on it.
    """

    vertices: tuple[int, ...]
    path: Path
    begin: float = -math.inf
    end: float = math.inf
    follows: bool = False


def check_holds(holds: Sequence[Hold], start: np.ndarray, begin: float) -> None:
    """Raises `InvalidArgumentError` unless vertices at `start` (n, 3) [m] can be held like that.

    A vertex has to exist, to be held once at a time, and to be within 5 cm of its way at the start
    unless it keeps its distance from it.
    """
    taken: list[tuple[int, float, float]] = []
    for number, hold in enumerate(holds):
        name = f"holds[{number}]"
        if not hold.begin < hold.end:
            raise InvalidArgumentError(f"{name}.end", hold.end, f"later than {hold.begin} s")
        path = np.asarray(hold.path(np.array([max(hold.begin, begin)])))
        shape = (1, len(hold.vertices), 3)
        if path.shape != shape or not np.isfinite(path).all():
            raise InvalidArgumentError(f"{name}.path", path.shape, f"finite, of a shape {shape}")
        for vertex, place in zip(hold.vertices, path[0], strict=True):
            if not 0 <= vertex < len(start):
                valid = f"indices of {len(start)} vertices"
                raise InvalidArgumentError(f"{name}.vertices", vertex, valid)
            for other, first, last in taken:
                if other == vertex and first < hold.end and hold.begin < last:
                    raise InvalidArgumentError(f"{name}.vertices", vertex, "held once at a time")
            taken.append((vertex, hold.begin, hold.end))
            away = float(np.linalg.norm(place - start[vertex]))
            if hold.begin <= begin and not hold.follows and away > REACH:
                valid = f"within {REACH} m of vertex {vertex}, at {start[vertex].tolist()}"
                raise InvalidArgumentError(f"{name}.path", place.tolist(), valid)


def replay(
    mesh: Mesh,
    fabric: Fabric,
    holds: Sequence[Hold],
    times: np.ndarray,
    *,
    start: np.ndarray | None = None,
    begin: float = 0.0,
    floor: float | None = 0.0,
    step: float = solver.TIMESTEP,
    by_area: bool = False,
    watched: bool = True,
) -> Replay:
    """Simulates a sheet whose held vertices follow their paths.

    Between steps vertices go straight. It is the same, bit for bit, whenever it is called.

    Args:
        mesh: the sheet at rest.
        fabric: what it is made of.
        holds: of vertices, none of which is held twice at a time.
        times: (f,) [s] in order, from `begin` on, at which vertices are asked for.
        start: where vertices are (n, 3) [m] at `begin`, at rest; None for where the mesh is.
        begin: when it starts [s]; before 0 for what is to happen before a recording starts.
        floor: height [m] of a plane without an end; None for none. Vertices lie half the fabric's
            thickness over it.
        step: of the physics [s]; the solver makes 25 of each.
        by_area: whether a vertex has the mass of the area around it. Else all have the same, as
            MuJoCo shares the mass of a flex: that of a grid's rim is twice that of its area, and a
            hem is too heavy, the more so the coarser the mesh is.
        watched: whether steps are taken down, which takes a fifth of the time; else only numbers
            that are not finite are a failure.

    Returns:
        Positions at `times`, what steps took and how they were, failures. After numbers that are
        not finite it stops.

    Raises:
        InvalidArgumentError: for shapes, times or holds that make no sense.
    """
    start = mesh.points if start is None else np.asarray(start, float)
    if start.shape != mesh.points.shape or not np.isfinite(start).all():
        raise InvalidArgumentError("start", start.shape, f"finite, of a shape {mesh.points.shape}")
    check_number("step", step, gt=0.0, lt=math.inf)
    check_holds(holds, start, begin)
    recorder = Recorder(mesh, times, floor)
    sheet, model, data = _compiled(mesh, fabric, floor, step)
    if by_area:
        _share_by_area(sheet, model, data, mesh, fabric.density)
    sheet.set_points(start)
    mujoco.mj_forward(model, data)
    recorder.start(begin, start)
    number = math.ceil((np.max(times, initial=begin) - begin) / step - _ROUNDING)
    ends = begin + step * np.arange(1, number + 1)
    hands = [_Hand(sheet, hold, begin, ends) for hold in holds]
    for i, end in enumerate(ends):
        for hand in hands:
            hand.let_go(end - step / 2)
        for hand in hands:
            hand.move(i, end - step / 2, step)
        took = stepped(model, data)
        if took is None:
            recorder.fail(float(end))
            break
        points = sheet.points()
        if not (recorder.add(float(end), points, took) if watched else recorder.see(end, points)):
            break
    return recorder.replay()


def stepped(model: mujoco.MjModel, data: mujoco.MjData) -> float | None:
    """Makes a step; returns the milliseconds of the CPU that it took, None if MuJoCo gave up."""
    before = time.thread_time()
    mujoco.mj_step(model, data)
    took = 1e3 * (time.thread_time() - before)
    return None if any(data.warning[kind].number for kind in _BAD) else took


class _Hand:
    """What makes a `Hold` of a sheet's vertices."""

    def __init__(self, sheet: BareSheet, hold: Hold, begin: float, ends: np.ndarray):
        self._sheet, self._hold, self._holds = sheet, hold, False
        self._path = np.asarray(hold.path(ends), float)
        self._first = np.asarray(hold.path(np.array([max(hold.begin, begin)])), float)[0]
        self._apart = np.zeros_like(self._first)

    def let_go(self, when: float) -> None:
        """Opens if it is to, before a step whose middle is at a time [s]."""
        if self._holds and when >= self._hold.end:
            self._holds = False
            for vertex in self._hold.vertices:
                self._sheet.release(vertex)

    def move(self, i: int, when: float, step: float) -> None:
        """Goes where it is to be after the step i, whose middle is at a time [s]."""
        if not self._hold.begin <= when < self._hold.end:
            return
        vertices = self._hold.vertices
        if not self._holds:
            self._holds = True
            for vertex in vertices:
                self._sheet.hold(vertex)
            if self._hold.follows:
                self._apart = self._sheet.points()[list(vertices)] - self._first
        for vertex, target in zip(vertices, self._path[i] + self._apart, strict=True):
            self._sheet.drive(vertex, target, step)


def _compiled(
    mesh: Mesh, fabric: Fabric, floor: float | None, step: float
) -> tuple[BareSheet, mujoco.MjModel, mujoco.MjData]:
    """A sheet over a floor, and nothing else."""
    root = mjcf.RootElement(model="replay")
    root.option.gravity = [0.0, 0.0, -fabrics.GRAVITY]
    sheet = BareSheet(mesh, fabric)
    number = len(mesh.points)
    memory = _LEAST_MEMORY + _MEMORY_OF_VERTEX * number + _MEMORY_OF_PAIR * number**2
    for part in (root, sheet.mjcf_model):
        part.size.memory, part.option.timestep = str(memory), step
    if floor is not None:
        # The larger of both coefficients of friction counts: that of the sheet.
        root.worldbody.add(
            "geom", type="plane", pos=[0, 0, floor], size=[_FLOOR_SIZE, _FLOOR_SIZE, 0.1],
            friction=[1e-3],
        )  # fmt: skip
    root.attach(sheet.mjcf_model)
    physics = mjcf.Physics.from_mjcf_model(root)
    sheet.after_compile(physics, None)
    return sheet, physics.model.ptr, physics.data.ptr


def _share_by_area(
    sheet: BareSheet, model: mujoco.MjModel, data: mujoco.MjData, mesh: Mesh, density: float
) -> None:
    """Gives each vertex the mass of a third of the triangles around it."""
    bodies = model.flex_vertbodyid[sheet.vertex_ids]
    share = density * mesh.vertex_areas / model.body_mass[bodies]
    model.body_mass[bodies] *= share
    model.body_inertia[bodies] *= share[:, None]
    mujoco.mj_setConst(model, data)
