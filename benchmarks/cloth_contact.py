"""What contact of a cloth with itself costs and how well it works: plugin, MuJoCo's own, none.

    OMP_NUM_THREADS=1 python benchmarks/cloth_contact.py --out benchmarks/cloth_contact.json

Times are milliseconds of the calling thread's CPU inside `mj_step`, which is one sim step of 10 ms.
The modes take turns within every repeat, so that whatever else the machine does hits all alike.
Figures are medians over the repeats, ratios are to MuJoCo's own self-collision in the same repeat.

fold: scripted folds of square cloths at 0.6 m/s. Lift, carry and lower are the thirds of the path,
    release is the first 0.3 s after the pickers open, rest the next 0.7 s, the episode all of this,
    folded the last two. Speeds are those of the vertices in the second second after the release.
fast: the same folds with one and with all three axes of a picker at full speed.
crumple: a vertex is lifted by 0.6 m at 1 m/s, held for 1.5 s and dropped. Fall is the first 0.5 s
    after that, heap the last 2 s of 3 s; the speed is that of the last second.
still: a cloth at rest flat on the floor, and one that hangs in the air by two corners.
task: env steps of `spread_cloth`, random actions, a second of CPU time; the same initial states.

Hits are intersections of an edge with a triangle, counted every 10th step (most) and at the end;
strain_99 is the 99th percentile of an edge's elongation (largest in a fold), or of its size at the
end of a crumple, where shortest is the smallest ratio of an edge's length to that at rest.
"""

import argparse
import itertools
import json
import math
import os
import pathlib
import platform
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from unittest import mock

import mujoco
import numpy as np

import softgym_mj
from softgym_mj.baselines.manipulation_scene import ManipulationScene, fold
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import Cloth
from softgym_mj.robots.base import SIM_STEP

MODES, REFERENCE = ("plugin", "mujoco", "none"), "mujoco"
DIMS = {20: 92, 26: 121, 32: 150}  # Size in SoftGym particles of cloths of n x n vertices.
FOLD_SPEED, FAST = 0.6, (1.0, math.sqrt(3.0))  # [m/s]
LARGE = 32  # Left out where it takes minutes.
PICKS = ((0.5, 0.5), (0.2, 0.7), (0.0, 0.0))  # Lifted vertices, as shares of the rows and columns.
LIFT, LIFT_SPEED, HOLD, DROP = 0.6, 1.0, 1.5, 3.0  # [m], [m/s], [s], [s]
HANGING_HEIGHT, SETTLING, TIMED = 1.3, 3.0, 1.0  # [m] of the held corners, [s], [s].
VARIATIONS, ENV_STEPS = range(800, 804), 40
INTERVAL = 10  # Sim steps between two counts of intersections.

Figures = dict[str, float]

TIMES = ("lift_ms", "carry_ms", "lower_ms", "release_ms", "rest_ms", "episode_ms", "folded_ms",
         "episode_ratio", "folded_ratio")  # fmt: skip
QUALITY = ("most_hits", "end_hits", "strain_99", "rms_mm/s", "max_mm/s", "contacts", "warnings",
           "held_error_mm", "lowest_mm", "settle_s")  # fmt: skip
CRUMPLE = ("lift_ms", "hang_ms", "fall_ms", "heap_ms", "heap_ratio", "most_hits", "end_hits",
           "strain_99", "shortest", "rms_mm/s", "warnings")  # fmt: skip
STILL = ("flat_ms", "hanging_ms", "flat_ratio", "hanging_ratio")
TABLES = {"fold": (TIMES, QUALITY), "fast": (QUALITY,), "crumple": (CRUMPLE,), "still": (STILL,),
          "task": (("env_steps/s",),)}  # fmt: skip


class Clock:
    """Stands in for `mujoco.mj_step` and keeps the thread CPU time [ms] of every call."""

    def __init__(self):
        self.times: list[float] = []
        self._step = mujoco.mj_step

    def __call__(self, model, data) -> None:
        start = time.thread_time()
        self._step(model, data)
        self.times.append(1e3 * (time.thread_time() - start))


class ClothAlone:
    """A cloth on the floor or in the air, flat at first."""

    def __init__(self, size: int, mode: str):
        arena = Arena(camera="cloth")
        self.cloth = Cloth((DIMS[size],) * 2, self_contact=mode)
        arena.attach(self.cloth)
        self.physics = arena.compile(SIM_STEP, self.cloth)
        self.cloth.set_vertices(self.cloth.flat())
        self.clock = Clock()
        self.goals: dict[int, np.ndarray] = {}
        self.squares: list[float] = []  # Mean square speed after every step.
        self.most_hits = 0

    def hold(self, vertices: Sequence[int]) -> None:
        """Holds these vertices from now on where they are, and lets go of others."""
        self.cloth.release_all()
        self.goals = {vertex: self.cloth.vertex(vertex) for vertex in vertices}
        for vertex in vertices:
            self.cloth.hold(vertex)

    def step(self, duration: float, velocity: float = 0.0) -> list[float]:
        """Steps for `duration` [s], held vertices up at `velocity` [m/s]; times of the steps."""
        steps = round(duration / SIM_STEP)
        for _ in range(steps):
            for vertex in self.goals:
                self.goals[vertex] += [0.0, 0.0, SIM_STEP * velocity]
                self.cloth.drive(vertex, self.goals[vertex], SIM_STEP)
            self.clock(self.physics.model.ptr, self.physics.data.ptr)
            self.squares.append(mean_square_speed(self.cloth))
            if len(self.squares) % INTERVAL == 0:
                self.most_hits = max(self.most_hits, self.cloth.intersections())
        return self.clock.times[-steps:]


def mean_square_speed(cloth: Cloth) -> float:
    """Mean square speed of the vertices [mm^2/s^2]."""
    return 1e6 * float(np.sum(cloth.velocities() ** 2)) / cloth.num_vertices


def measure_fold(size: int, speed: float, mode: str) -> Figures:
    cloth, clock = Cloth((DIMS[size],) * 2, self_contact=mode), Clock()
    squares: list[float] = []
    scene = ManipulationScene(cloth, on_step=lambda _: squares.append(mean_square_speed(cloth)))
    with mock.patch.object(mujoco, "mj_step", clock):
        fold(scene, speed, rest=2.0)
    record, times = scene.record, np.array(clock.times[:-100])
    folded = times[-100:]
    phases = [*np.array_split(times[1:-100], 3), folded[:30], folded[30:], times, folded]
    return {
        **{name: float(np.mean(phase)) for name, phase in zip(TIMES[:7], phases, strict=True)},
        "most_hits": record.most_intersections,
        "end_hits": record.end_intersections,
        "strain_99": record.strain_99,
        "rms_mm/s": math.sqrt(statistics.mean(squares[-100:])),
        "max_mm/s": 1e3 * max(record.max_speeds[-100:]),
        "contacts": int(scene.physics.data.ptr.ncon),
        "warnings": record.warnings,
        "held_error_mm": 1e3 * record.held_error,
        "lowest_mm": 1e3 * record.lowest,
        "settle_s": record.settle_time(),
    }


def measure_crumple(size: int, pick: tuple[float, float], mode: str) -> Figures:
    scene = ClothAlone(size, mode)
    rows, columns = scene.cloth.shape
    scene.hold([scene.cloth.index(round(pick[0] * (rows - 1)), round(pick[1] * (columns - 1)))])
    lift = scene.step(LIFT / LIFT_SPEED, LIFT_SPEED)
    hang = scene.step(HOLD)
    scene.hold([])
    drop = scene.step(DROP)
    strain = scene.cloth.edge_strain()
    phases = (lift, hang, drop[:50], drop[-200:])
    return {
        **{name: float(np.mean(phase)) for name, phase in zip(CRUMPLE[:4], phases, strict=True)},
        "most_hits": scene.most_hits,
        "end_hits": scene.cloth.intersections(),
        "strain_99": float(np.percentile(np.abs(strain), 99)),
        "shortest": float(1.0 + strain.min()),
        "rms_mm/s": math.sqrt(statistics.mean(scene.squares[-100:])),
        "warnings": int(scene.physics.data.ptr.warning.number.sum()),
    }


def measure_still(size: int, mode: str) -> Figures:
    flat, hanging = ClothAlone(size, mode), ClothAlone(size, mode)
    x, y, _ = hanging.cloth.flat().T
    height = HANGING_HEIGHT + y - y.max()
    hanging.cloth.set_vertices(np.column_stack([x, np.zeros_like(x), height]))
    hanging.hold(hanging.cloth.corners[[0, 2]].tolist())
    for scene in (flat, hanging):
        scene.step(SETTLING)
    return {name: statistics.mean(scene.step(TIMED))
            for name, scene in (("flat_ms", flat), ("hanging_ms", hanging))}  # fmt: skip


def measure_task(variation: int, mode: str) -> Figures:
    env = softgym_mj.load("spread_cloth", split="evaluate", self_contact=mode)
    env.reset(variation)
    actions = np.random.default_rng(variation).uniform(-1, 1, (ENV_STEPS, *env.action_spec().shape))
    start = time.thread_time()
    for action in actions:
        env.step(action)
    return {"env_steps/s": ENV_STEPS / (time.thread_time() - start)}


def compare(
    measure: Callable[..., Figures], arguments: Sequence, modes: Sequence[str], repeats: int
) -> dict[str, Figures]:
    """Medians of all figures by mode, with the ratios of times to those of `REFERENCE`."""
    rounds: dict[str, list[Figures]] = {mode: [] for mode in modes}
    for _ in range(repeats):
        once = {mode: measure(*arguments, mode) for mode in modes}
        for mode, figures in once.items():
            costs = [name for name in figures if name.endswith("_ms")]
            ratios = {f"{name[:-3]}_ratio": figures[name] / once[REFERENCE][name] for name in costs}
            rounds[mode].append({**figures, **ratios})
    return {
        mode: {name: statistics.median(one[name] for one in figures) for name in figures[0]}
        for mode, figures in rounds.items()
    }


def jobs(sizes: Sequence[int]) -> Iterator[tuple[str, str, Callable[..., Figures], tuple]]:
    """(Part, label, function, its arguments before the mode) of all that is measured."""
    smaller = [size for size in sizes if size < LARGE]
    for size in sizes:
        yield "still", f"{size}", measure_still, (size,)
        yield "fold", f"{size}", measure_fold, (size, FOLD_SPEED)
    for size, speed in itertools.product(smaller, FAST):
        yield "fast", f"{size} {speed:.2f} m/s", measure_fold, (size, speed)
    for size, pick in itertools.product(smaller, PICKS):
        yield "crumple", f"{size} {pick}", measure_crumple, (size, pick)
    for variation in VARIATIONS:
        yield "task", f"{variation}", measure_task, (variation,)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--parts", nargs="+", choices=TABLES, default=tuple(TABLES))
    parser.add_argument("--sizes", type=int, nargs="+", choices=DIMS, default=tuple(DIMS))
    parser.add_argument("--repeats", type=int, default=3, help="of fold and still; others once")
    arguments = parser.parse_args()
    results: dict[str, dict[str, dict[str, Figures]]] = {part: {} for part in arguments.parts}
    for part, label, measure, inputs in (j for j in jobs(arguments.sizes) if j[0] in results):
        modes = MODES[:2] if part == "task" else MODES
        repeats = arguments.repeats if part in ("fold", "still") else 1
        found = results[part][label] = compare(measure, inputs, modes, repeats)
        for columns in TABLES[part]:
            print(f"\n{part + ' ' + label:20}" + "".join(f"{name:>15}" for name in columns))
            for mode, figures in found.items():
                row = "".join(f"{figures[name]:15.4g}" for name in columns)
                print(f"{mode:20}{row}", flush=True)
    if arguments.out:
        machine = {"processor": platform.processor(), "mujoco": mujoco.__version__,
                   "load_average": os.getloadavg()}  # fmt: skip
        arguments.out.write_text(json.dumps({"machine": machine, **results}, indent=2))


if __name__ == "__main__":
    main()
