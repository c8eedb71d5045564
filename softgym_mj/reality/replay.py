"""Replays a recording of real cloth: a sheet whose held vertices follow the paths of hands.

    mesh = rectangle(0.6, 0.6, 0.03)
    hold = Hold((0, 20), lambda times: np.array(...))  # (n,) [s] to (n, 2, 3) [m].
    replay(mesh, Fabric.named("black_denim"), [hold], times=np.arange(0.0, 4.4, 1 / 30))

It returns a `Replay`.
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

REACH = 0.05  # [m] Largest initial distance of a held vertex from its path.
# [bytes] Memory of a step, per vertex and per pair of vertices, which MuJoCo treats as bodies; its
# default is too small for thousands of vertices.
_MEMORY_OF_VERTEX, _MEMORY_OF_PAIR, _LEAST_MEMORY = 2**14, 3, 2**24
_FLOOR_SIZE = 10.0  # [m] Rendered size; the plane is infinite.
_ROUNDING = 1e-9  # [s]
# MuJoCo resets the simulation and warns if values are bad.
_BAD = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)

Path = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class Hold:
    """Vertices that follow a path while they are held.

    Attributes:
        vertices: (k,) indices.
        path: returns positions (n, k, 3) [m] at times (n,) [s].
        begin, end: start and end of the hold [s]; then the vertices are released.
        follows: whether vertices keep their offsets from the path, such as that of a hand which
            holds them; else they are on it.
    """

    vertices: tuple[int, ...]
    path: Path
    begin: float = -math.inf
    end: float = math.inf
    follows: bool = False


def check_holds(holds: Sequence[Hold], start: np.ndarray, begin: float) -> None:
    """Raises `InvalidArgumentError` unless vertices at `start` (n, 3) [m] can be held in this way.

    A vertex must exist, be held once at a time, and be within 5 cm of its path at the start unless
    it keeps its offset from it.
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

    Between steps vertices are interpolated linearly. The result is bit-identical for equal
    arguments.

    Args:
        mesh: the sheet at rest.
        fabric: the fabric.
        holds: holds of vertices, each of which is held once at a time.
        times: (f,) [s] in order, from `begin` on, for which vertices are returned.
        start: vertices (n, 3) [m] at `begin`, at rest; None for those of the mesh.
        begin: start of the simulation [s]; negative for a preparation before the recording.
        floor: height [m] of an infinite plane; None for none. Vertices rest half the fabric's
            thickness over it.
        step: physics step [s], of 25 substeps.
        by_area: whether a vertex has the mass of the area around it. Else all have the same mass,
            as in MuJoCo: twice the mass of its area at a grid's rim, so that a hem is too heavy,
            the more the coarser the mesh.
        watched: whether statistics of steps are recorded, which takes a fifth of the time; else
            only values that are not finite are a failure.

    Returns:
        Positions at `times`, statistics of the steps, failures. The simulation stops after values
        that are not finite.

    Raises:
        InvalidArgumentError: for invalid shapes, times or holds.
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
    """Simulates a step; returns its CPU time [ms], or None if MuJoCo failed."""
    before = time.thread_time()
    mujoco.mj_step(model, data)
    took = 1e3 * (time.thread_time() - before)
    return None if any(data.warning[kind].number for kind in _BAD) else took


class _Hand:
    """Applies a `Hold` to a sheet's vertices."""

    def __init__(self, sheet: BareSheet, hold: Hold, begin: float, ends: np.ndarray):
        self._sheet, self._hold, self._holds = sheet, hold, False
        self._path = np.asarray(hold.path(ends), float)
        self._first = np.asarray(hold.path(np.array([max(hold.begin, begin)])), float)[0]
        self._apart = np.zeros_like(self._first)

    def let_go(self, when: float) -> None:
        """Releases the vertices if due, before a step whose middle is at a time [s]."""
        if self._holds and when >= self._hold.end:
            self._holds = False
            for vertex in self._hold.vertices:
                self._sheet.release(vertex)

    def move(self, i: int, when: float, step: float) -> None:
        """Moves the vertices to their positions after the step i, whose middle is at a time [s]."""
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
    """Compiles a sheet over a floor, and nothing else."""
    root = mjcf.RootElement(model="replay")
    root.option.gravity = [0.0, 0.0, -fabrics.GRAVITY]
    sheet = BareSheet(mesh, fabric)
    number = len(mesh.points)
    memory = _LEAST_MEMORY + _MEMORY_OF_VERTEX * number + _MEMORY_OF_PAIR * number**2
    for part in (root, sheet.mjcf_model):
        part.size.memory, part.option.timestep = str(memory), step
    if floor is not None:
        # MuJoCo uses the larger of both friction coefficients: that of the sheet.
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
