"""A T-shirt of 5,000 and 20,000 vertices in two hands: flung, folded, grasped.

    python -m benchmarks.shirts --folder out/shirts --out docs/shirts.json

A flat tube with sleeves, of the size of an adult's and as fine as the garments that RGBench
simulates; two given vertices go where hands go. Fabrics are RGBench's T-shirt as it is published,
230 N/m, and with the stretch of a woven, 1 kN/m. Intersections are counted at the end. The same
command goes on where it was stopped. `python -m tools.tables` shows docs/shirts.json.
"""

import argparse
import dataclasses
import json
import pathlib
import time
from collections.abc import Callable
from typing import Any

import imageio.v3 as iio
import mujoco
import numpy as np

from benchmarks.cloth import speed_of_machine
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.entities.sheet import Fabric
from softgym_mj.jobs.files import write_whole
from softgym_mj.jobs.store import JSON, Store
from softgym_mj.reality.garment_scene import THICKNESS
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.pictures import Painter, beside, camera_at
from softgym_mj.reality.primitives import duration, gripper_positions
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.replay import Hold, replay

# In units of the outline, from the middle and from the hem: half the body's and the neck's width,
# to the end of a sleeve; where sleeves begin, the shoulders; depths of the neck.
BODY, NECK, SLEEVE, ARMPIT, SHOULDER = 5, 2, 8, 9, 13
DEPTHS = {1.0: 2.5, -1.0: 1.0}  # Of the neck in front and behind.
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))  # Of a cell, counter-clockwise.
UNIT = 0.056  # [m] Of the outline: 0.56 m wide, 0.73 m long.
FINER = {"5k": 4, "20k": 8}  # Edges in a unit.
GAP = 0.00308  # [m] Of both layers, as in RGBench's T-shirts.
FABRIC = "rgbench_t_shirt"
STRETCHES = {"published": 230.0, "woven": 1000.0}  # [N/m]
REST = 1.0  # [s] At the beginning, and after hands have opened.

# The picture: moments of each action [s], the camera's place and what it sees [m].
MOMENTS = {
    "fling": (0.0, 3.0, 5.0, 7.0, 8.0, 10.4),
    "fold": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    "grasp": (1.0, 1.8, 2.4, 3.0, 4.0, 5.0),
}
CAMERAS = {
    "fling": (np.array([1.3, 2.3, 1.5]), np.array([0.0, 0.2, 0.55])),
    "fold": (np.array([0.7, -1.2, 1.2]), np.array([0.0, 0.35, 0.1])),
    "grasp": (np.array([0.7, -1.2, 1.2]), np.array([0.0, 0.35, 0.25])),
}
SIZE, FIELD_OF_VIEW = (260, 260), 40.0  # [pixels], [deg]

Row = dict[str, Any]
Path = Callable[[np.ndarray], np.ndarray]


def shirt(finer: int) -> Mesh:
    """Two layers that are sewn at the sides, the shoulders and along sleeves; Z up, hem at -Y."""
    points: list[tuple[float, float, float]] = []
    index: dict[tuple[int, int, float], int] = {}
    triangles: list[tuple[int, ...]] = []

    def vertex(i: int, j: int, side: float) -> int:
        column, row = abs(i), j
        sewn = (
            (column == BODY * finer and row <= ARMPIT * finer)
            or (row == SHOULDER * finer and column >= NECK * finer)
            or (row == ARMPIT * finer and column >= BODY * finer)
        )
        key = (i, j, 0.0 if sewn else side)
        if key not in index:
            index[key] = len(points)
            points.append((i * UNIT / finer, j * UNIT / finer, key[2] * GAP / 2.0))
        return index[key]

    for side, depth in DEPTHS.items():
        for j in range(SHOULDER * finer):
            for i in range(-SLEEVE * finer, SLEEVE * finer):
                column, row = abs(i + 0.5) / finer, (j + 0.5) / finer
                open_above = SHOULDER - depth * (1.0 - (column / NECK) ** 2)
                if (column < NECK and row > open_above) or (column > BODY and row < ARMPIT):
                    continue
                a, b, c, d = (vertex(i + right, j + up, side) for right, up in CORNERS)
                faces = [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
                triangles += faces if side > 0 else [face[::-1] for face in faces]
    return Mesh(np.array(points), np.array(triangles))


def nearest(mesh: Mesh, *places: tuple[float, float]) -> tuple[int, ...]:
    """The upper vertices at places in units of the outline."""
    found = []
    for place in places:
        away = np.linalg.norm(mesh.points[:, :2] - np.array(place) * UNIT, axis=1)
        found.append(int(np.argmin(away - 1e-6 * mesh.points[:, 2])))
    return tuple(found)


def fling(mesh: Mesh, start: np.ndarray) -> tuple[list[Hold], float]:
    """Lifted by the shoulders, flung as rags are: hands, and until when [s]."""
    held = nearest(mesh, (-4, SHOULDER), (4, SHOULDER))
    own = start[list(held)]
    rags = gripper_positions("dynamic", np.zeros(1))[0]
    high = own + [0.0, 0.0, 0.95]

    def path(times: np.ndarray) -> np.ndarray:
        share = smooth((times - REST) / 3.0)[:, None, None]
        flung = gripper_positions("dynamic", times - REST - 4.0) - rags
        return own + share * (high - own) + flung

    return [Hold(held, path)], REST + 4.0 + duration("dynamic") + REST


def fold(mesh: Mesh, start: np.ndarray) -> tuple[list[Hold], float]:
    """The hem's corners are laid upon the shoulders, and let go of."""
    held = nearest(mesh, (-BODY, 0), (BODY, 0))
    own = start[list(held)]

    def path(times: np.ndarray) -> np.ndarray:
        share = smooth((times - REST) / 4.0)
        angle = np.pi * share
        radius = SHOULDER * UNIT / 2.0 - 0.02
        way = np.stack([0.0 * share, 1.0 - np.cos(angle), 0.8 * np.sin(angle)], axis=1)
        return own + radius * way[:, None] + share[:, None, None] * [0.0, 0.0, 0.01]

    return [Hold(held, path, begin=REST, end=REST + 4.0)], REST + 4.0 + REST


def grasp(mesh: Mesh, start: np.ndarray) -> tuple[list[Hold], float]:
    """Two places of the chest are lifted and held."""
    held = nearest(mesh, (-2, 7), (2, 7))
    own = start[list(held)]

    def path(times: np.ndarray) -> np.ndarray:
        return own + 0.5 * smooth((times - REST) / 2.0)[:, None, None] * [0.0, 0.0, 1.0]

    return [Hold(held, path, begin=REST)], REST + 2.0 + 2.0 * REST


ACTIONS = {"fling": fling, "fold": fold, "grasp": grasp}


def smooth(share: np.ndarray) -> np.ndarray:
    """From 0 to 1 without jerks at the ends."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def replayed(size: str, stretch: str, action: str, rate: float = 10.0) -> tuple[Mesh, Replay]:
    """A run, at so many frames a second."""
    mesh = shirt(FINER[size])
    fabric = dataclasses.replace(
        Fabric.named(FABRIC), thickness=THICKNESS, stretch_stiffness=STRETCHES[stretch]
    )
    start = mesh.points + [0.0, 0.0, GAP / 2.0 + THICKNESS / 2.0]
    holds, end = ACTIONS[action](mesh, start)
    times = np.append(np.arange(0.0, end, 1.0 / rate), end)
    return mesh, replay(mesh, fabric, holds, times, start=start)


def run(size: str, stretch: str, action: str) -> Row:
    """Figures of a run."""
    begun = time.perf_counter()
    mesh, found = replayed(size, stretch, action)
    last = found.positions[-1]
    finite = bool(np.isfinite(last).all())
    return {
        "vertices": len(mesh.points),
        "triangles": len(mesh.triangles),
        "edge_mm": 1e3 * float(np.median(mesh.lengths)),
        "intersections": count_intersections(last, mesh.edges, mesh.triangles) if finite else None,
        "failures": [dataclasses.asdict(failure) for failure in found.failures],
        "strain_99": found.strain_99,
        "strain_max": float(found.steps.strain_max.max()),
        "lowest_m": found.lowest,
        "milliseconds": found.milliseconds,
        "real_time_factor": found.real_time_factor,
        "wall_s": time.perf_counter() - begun,
    }


def strip(extension: str) -> bytes:
    """A picture: a row for each action of the 5k shirt, at some moments."""
    rows = []
    for action, moments in MOMENTS.items():
        mesh, found = replayed("5k", "published", action)
        camera = camera_at(*CAMERAS[action], SIZE, FIELD_OF_VIEW)
        painter = Painter.of(mesh.points, mesh.triangles, camera, SIZE, 0.0)
        frames = [found.positions[np.argmin(np.abs(found.times - t))] for t in moments]
        rows.append(beside([painter.sheet(vertices) for vertices in frames]))
    return iio.imwrite("<bytes>", np.concatenate(rows), extension=extension)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=pathlib.Path, required=True, help="of what is done")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("docs/shirts.json"))
    parser.add_argument("--done", action="store_true", help="write what is done, and run nothing")
    parser.add_argument("--strip", type=pathlib.Path, help="draw this picture, and nothing else")
    arguments = parser.parse_args()
    if arguments.strip:
        write_whole(arguments.strip, strip(arguments.strip.suffix))
        return
    specification = {
        "mujoco": mujoco.__version__,
        "unit_m": UNIT,
        "stretches": STRETCHES,
        "material": Fabric.named(FABRIC).material(),
    }
    store = Store(arguments.folder, specification, JSON)
    rows: list[Row] = []

    def keep(key: tuple[str, str, str], value: Row) -> None:
        print(*key, json.dumps(value), flush=True)
        rows.append(dict(zip(("size", "stretch", "action"), key, strict=True)) | value)

    keys = [("5k", "published", action) for action in ACTIONS]
    keys += [("20k", "published", action) for action in ("grasp", "fold", "fling")]
    keys += [("5k", "woven", action) for action in ACTIONS]
    store.run([key for key in keys if store.has(key) or not arguments.done], run, progress=keep)
    rows.sort(key=lambda row: keys.index((row["size"], row["stretch"], row["action"])))
    result = {
        **specification,
        "machine": speed_of_machine(),
        "runs": rows,
    }
    arguments.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
