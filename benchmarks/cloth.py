"""What a cloth costs and how well it keeps its shape.

    OMP_NUM_THREADS=1 python -m benchmarks.cloth --out docs/cloth.json

Times are milliseconds of the thread's CPU time inside `mj_step`, a sim step of 10 ms.

fold: a square cloth lies flat for a second and is folded by two pickers. Lift, carry and lower are
    the thirds of their way, release is the first 0.3 s after they open, rest the next 0.7 s, fold
    all of lower, release and rest. Figures are medians of three folds.
pile: a vertex is lifted by 0.6 m at 1 m/s, held for 1.5 s and let go of; the last 2 s of 6 s.

strain_99 is the 99th percentile of an edge's elongation, largest in a fold, and hits are
intersections of an edge with a triangle, most at a time.
"""

import argparse
import itertools
import json
import pathlib
import statistics
import time
from unittest import mock

import mujoco
import numpy as np

from benchmarks.machine import machine, yardstick
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from tests.scenes.manipulation import ManipulationScene, fold

SIZES = {21: 97, 33: 155}  # Sizes in SoftGym's particles, of n x n vertices.
SPEEDS = (0.6, 1.73)  # [m/s] Pickers: the experts' speed, and full speed along three axes.
FOLDS = 3
PICK = (0.2, 0.7)  # The vertex that is lifted, as shares of the rows and columns.
LIFT, LIFT_SPEED, HOLD, DROP = 0.6, 1.0, 1.5, 6.0  # [m], [m/s], [s], [s]
SIM_STEP = 0.01  # [s]
FLAT_STEPS, RELEASE_STEPS, REST_STEPS, PILE_STEPS = 100, 30, 70, 200
INTERVAL = 10  # Sim steps between two counts of intersections.

Figures = dict[str, float]

# Columns of the printed tables: a figure, its format, and what it is multiplied by.
COLUMNS = {
    "fold": {
        "vertices": ("size", "{0} x {0}", 1), "speed, m/s": ("speed", "{}", 1),
        **{f"{name}, ms": (f"{name}_ms", "{:.2f}", 1)
           for name in ("flat", "lift", "carry", "fold", "all")},
        "p99 strain, %": ("strain_99", "{:.1f}", 100), "lowest, mm": ("lowest_mm", "{:.1f}", 1),
        "hits": ("hits", "{:.0f}", 1),
    },
    "pile": {
        "vertices": ("size", "{0} x {0}", 1),
        **{f"{name}, ms": (f"{name}_ms", "{:.2f}", 1) for name in ("lift", "hang", "fall", "pile")},
        "drift, mm/s": ("drift_mm/s", "{:.3f}", 1), "lowest, mm": ("lowest_mm", "{:.1f}", 1),
        "hits": ("hits", "{:.0f}", 1),
    },
}  # fmt: skip


class Clock:
    """Stands in for `mujoco.mj_step` and keeps the thread CPU time [ms] of every call."""

    def __init__(self):
        self.times: list[float] = []
        self._step = mujoco.mj_step

    def __call__(self, model, data) -> None:
        start = time.thread_time()
        self._step(model, data)
        self.times.append(1e3 * (time.thread_time() - start))


def measure_fold(size: int, speed: float) -> Figures:
    """Phases of a fold, and how the cloth came through."""
    clock = Clock()
    scene = ManipulationScene(Cloth(dims=(SIZES[size],) * 2))
    with mock.patch.object(mujoco, "mj_step", clock):
        for _ in range(FLAT_STEPS):
            scene.step(np.zeros((2, 3)), grip=False)
        fold(scene, speed, rest=SIM_STEP * (RELEASE_STEPS + REST_STEPS))
    times = np.array(clock.times)
    flat, after = times[:FLAT_STEPS], times[-RELEASE_STEPS - REST_STEPS :]
    lift, carry, lower = np.array_split(times[FLAT_STEPS + 1 : -len(after)], 3)
    phases = {"flat": flat, "lift": lift, "carry": carry, "lower": lower,
              "release": after[:RELEASE_STEPS], "rest": after[RELEASE_STEPS:],
              "fold": np.concatenate([lower, after]), "all": times[FLAT_STEPS:]}  # fmt: skip
    return {
        **{f"{name}_ms": float(np.mean(phase)) for name, phase in phases.items()},
        "strain_99": scene.record.strain_99,
        "lowest_mm": 1e3 * scene.record.lowest,
        "hits": max(scene.record.most_intersections, scene.record.end_intersections),
    }


def measure_pile(size: int) -> Figures:
    """A crumpled cloth that comes to rest."""
    arena, cloth, clock = Arena("cloth"), Cloth(dims=(SIZES[size],) * 2), Clock()
    arena.attach(cloth)
    physics = arena.compile(SIM_STEP, cloth)
    cloth.set_points(cloth.flat())
    vertex = cloth.index(*(round(share * (size - 1)) for share in PICK))
    goal, hits, strain = cloth.vertex(vertex), 0, 0.0
    cloth.hold(vertex)
    lifting, dropping = round(LIFT / LIFT_SPEED / SIM_STEP), round(DROP / SIM_STEP)
    ends = np.cumsum([lifting, round(HOLD / SIM_STEP), dropping])
    for step in range(ends[2]):
        if step == ends[1]:
            cloth.release_all()
        if step < ends[1]:
            goal[2] += SIM_STEP * LIFT_SPEED * (step < ends[0])
            cloth.drive(vertex, goal, SIM_STEP)
        clock(physics.model.ptr, physics.data.ptr)
        if step % INTERVAL == 0:
            hits = max(hits, cloth.intersections())
            strain = max(strain, float(np.percentile(cloth.edge_strain(), 99)))
        if step == ends[2] - 1 - round(1.0 / SIM_STEP):
            before = cloth.points()
    times = np.array(clock.times)
    return {
        "lift_ms": float(times[: ends[0]].mean()),
        "hang_ms": float(times[ends[0] : ends[1]].mean()),
        "fall_ms": float(times[ends[1] : ends[1] + 50].mean()),
        "pile_ms": float(times[-PILE_STEPS:].mean()),
        "strain_99": strain,
        "lowest_mm": 1e3 * float(cloth.points()[:, 2].min()),
        "drift_mm/s": 1e3 * float(np.linalg.norm(cloth.points() - before, axis=1).mean()),
        "hits": hits,
    }


def table(part: str, rows: list[Figures]) -> str:
    """Rows of a part as a table of Markdown."""
    columns = COLUMNS[part]
    lines = [list(columns), ["---"] * len(columns)]
    for row in rows:
        lines.append([form.format(factor * row[name]) for name, form, factor in columns.values()])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    folds = []
    for size, speed in itertools.product(SIZES, SPEEDS):
        found = [measure_fold(size, speed) for _ in range(FOLDS)]
        medians = {name: statistics.median(each[name] for each in found) for name in found[0]}
        folds.append({"size": size, "speed": speed, **medians})
    print(table("fold", folds))
    piles = [{"size": size, **measure_pile(size)} for size in SIZES]
    print(table("pile", piles))
    if arguments.out:
        where = {**machine(), "humanoid_mj_steps_per_second": yardstick()}
        content = {"machine": where, "fold": folds, "pile": piles}
        arguments.out.write_text(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
