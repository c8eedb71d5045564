"""Recordings of garments as a scene: a mesh with two vertices that follow the end effectors.

As in the benchmark's mode of fixed points. A fling: given vertices go from where the garment lies
to where the arms start, wait, and follow. A fold or grasp: when what counts begins, the vertex that
is nearest to each end effector is taken, and follows. The start is not recorded: the garment lies
flat at the benchmark's default place.
"""

import pathlib
from collections.abc import Mapping

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.mesh_files import read_mesh
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality.garments import ARMS, Capture
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.replay import Hold, Path, recorded_path, replay

PLACE = (0.1, 0.0)  # [m] X and Y of the origin of the mesh, by the benchmark's default.
# [m] Y of the arms' bases by the benchmark's code; one of its texts has it the other way round.
BASES = {"left": 0.25, "right": -0.25}
# [m] Panels of the T-shirt are 3.08 mm apart: thicker layers would push each other away.
THICKNESS = 0.0025
PREPARE, WAIT = 5.0, 5.0  # [s] Of a fling, before it.
SETTLE = 1.0  # [s] Of a garment that lies flat, before it is taken.
GRIP = 0.1  # [s] In which a vertex goes to the end effector that takes it.


def garment_mesh(file: pathlib.Path) -> Mesh:
    """The mesh of an OBJ.

    Raises:
        InvalidArgumentError: if it cannot be read.
    """
    points, triangles = read_mesh(file)
    used = np.unique(triangles)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    return Mesh(points[used], number[triangles])


def vertices_of_file(file: pathlib.Path, mesh: Mesh, numbers: tuple[int, ...]) -> tuple[int, ...]:
    """Which vertices of a mesh are these of its OBJ, which may list some twice or without use.

    Raises:
        StoreError: if the file has no such vertices, or none of the mesh is there.
    """
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
        places = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    except (OSError, ValueError) as error:
        raise StoreError(f"{file}: missing or no OBJ ({error})") from error
    found = []
    for vertex in numbers:
        if not 0 <= vertex < len(places):
            raise StoreError(f"{file}: has {len(places)} vertices, and no vertex {vertex}")
        away = np.linalg.norm(mesh.points - places[vertex], axis=1)
        if away.min() > 1e-5:
            raise StoreError(f"{file}: vertex {vertex} is in no triangle")
        found.append(int(np.argmin(away)))
    return tuple(found)


def laid(mesh: Mesh, fabric: Fabric, place: tuple[float, float] = PLACE) -> np.ndarray:
    """Vertices (n, 3) [m] of a mesh that lies on the floor, its origin at X and Y [m]."""
    low = mesh.points[:, 2].min()
    return mesh.points + [*place, fabric.thickness / 2.0 - low]


def ends(capture: Capture, bases: Mapping[str, float] = BASES) -> dict[str, Path]:
    """Where each end effector is (n, 1, 3) [m] at times (n,) [s] after the joints' first stamp.

    Raises:
        StoreError: if the recording does not say where end effectors were.
    """
    paths = {}
    for arm in ARMS:
        states = capture.arms[arm]
        if states.ends is None:
            raise StoreError(
                f"{capture.garment} {capture.action}: the {arm} arm's file has no columns pos_x, "
                "pos_y, pos_z of the end effector"
            )
        world = states.ends + [0.0, bases[arm], 0.0]
        paths[arm] = recorded_path(states.times - capture.first_stamp, world[:, None])
    return paths


def nearest(positions: np.ndarray, paths: Mapping[str, Path], when: float) -> tuple[int, ...]:
    """The vertex of positions (n, 3) [m] nearest to each end effector at a time [s]."""
    found = []
    for path in paths.values():
        away = np.linalg.norm(positions - path(np.array([when]))[0], axis=1)
        found.append(int(np.argmin(away)))
    return tuple(found)


def replay_garment(
    mesh: Mesh,
    fabric: Fabric,
    action: str,
    paths: Mapping[str, Path],
    times: np.ndarray,
    *,
    begin: float,
    held: tuple[int, ...] | None = None,
    place: tuple[float, float] = PLACE,
    step: float = solver.TIMESTEP,
) -> tuple[Replay, tuple[int, ...]]:
    """What a garment does.

    Args:
        mesh: of the garment, flat.
        fabric: what it is made of.
        action: "fling", "fold" or "grasp".
        paths: of `ends`.
        times: (f,) [s] in order, after the joints' first stamp.
        begin: when what counts begins [s].
        held: vertices that the left and right arm hold; of a fold or grasp None for the nearest.
        place: of the origin of the mesh, X and Y [m].
        step: of the physics [s].

    Returns:
        The replay, and which vertices were held.

    Raises:
        StoreError: for a fling without `held`.
    """
    start = laid(mesh, fabric, place)
    if action == "fling":
        if held is None:
            raise StoreError("which vertices of the mesh hands hold in a fling is not known")
        holds = [
            Hold((vertex,), _flung(start[vertex], path))
            for vertex, path in zip(held, paths.values(), strict=True)
        ]
        first = -(PREPARE + WAIT)
    else:
        held = nearest(start, paths, begin) if held is None else held
        holds = [
            Hold((vertex,), _taken(start[vertex], path, begin), begin=begin)
            for vertex, path in zip(held, paths.values(), strict=True)
        ]
        if len(set(held)) < len(held):
            holds = holds[:1]  # Both arms are nearest to the same vertex: one holds it.
        first = min(begin, float(times[0])) - SETTLE
    found = replay(mesh, fabric, holds, times, start=start, begin=first, step=step)
    return found, held


def _flung(start: np.ndarray, path: Path) -> Path:
    """From a place (3,) to the path's start, a wait, the path."""
    beginning = path(np.zeros(1))[0]

    def places(times: np.ndarray) -> np.ndarray:
        share = np.clip((times + PREPARE + WAIT) / PREPARE, 0.0, 1.0)[:, None, None]
        before = (1.0 - share) * start + share * beginning
        return np.where((times < 0.0)[:, None, None], before, path(times))

    return places


def _taken(start: np.ndarray, path: Path, begin: float) -> Path:
    """From a place (3,) to the path within a moment."""
    away = start - path(np.array([begin]))[0]

    def places(times: np.ndarray) -> np.ndarray:
        left = np.clip(1.0 - (times - begin) / GRIP, 0.0, 1.0)[:, None, None]
        return path(times) + left * away

    return places
