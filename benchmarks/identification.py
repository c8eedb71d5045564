"""Are parameters of a fabric recovered from recordings of it? Secret ones, drawn at random.

Each draw is a rag of secret parameters, simulated at twice the resolution and half the step, seen
by one camera with 5 mm of noise, 30 frames a second, 33 ms late: written in the layout of the real
data set and read from there. A sequence that is held out has a clock that is off by a secret error.
The first draws are done a second time without noise, from the same mesh and step.

    python benchmarks/identification.py --jobs 32 --out identification   # All draws; or some:
    python benchmarks/identification.py --draws 0 1 2 --jobs 8 --out identification
    python benchmarks/identification.py --merge identification docs/identification.json

It may be killed and run again with the same folder: it goes on from the last generation. Searches
of all draws go on side by side, so that many processes have something to do.
"""

import argparse
import dataclasses
import json
import math
import os
import pathlib
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")  # Before NumPy is loaded, here and in processes.

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.parallel.executors import Executor, make_executor
from softgym_mj.reality.identification import identify, synthetic, unknowns
from softgym_mj.reality.identification.rag_data import CAMERA, SPACING, read_task
from softgym_mj.reality.identification.search import EVALUATIONS, run_searches
from softgym_mj.reality.identification.tasks import Task, evaluate, motions
from softgym_mj.storage.files import read_json, write_json

DRAWS = tuple(range(10))
EXACT = tuple(range(3))  # Draws that are also done without noise.
SEEDS = 2
CLOTH = "linen"  # Whose name and numbers of frames the data have.
LATENCY = 0.033  # [s]
NOISE = 0.005  # [m]
STEP = 0.01  # [s] Of searches.
DENSITY = 0.2  # [kg/m^2] Known, as from scales.

# What is secret is drawn from: gravity bending lengths [m], from the 10th to the 90th percentile of
# 618 fabrics of 150 to 300 g/m^2; the rest uniform.
BENDING_LENGTH = (0.0135, 0.0275)
DRAG = (0.8, 2.0)
ADDED_MASS = (0.05, 0.25)  # [kg/m^2]
FRICTION = (0.2, 1.0)
STRETCH = (250.0, 700.0)  # [N/m] What substeps can follow.
SLIP = (0.08, 0.4)  # [s]
GRAVITY = 9.81  # [m/s^2]

# How near is near enough: of the value, of latency and clock error in [s].
BOUNDS = {"bending": 0.15, "drag": 0.15, "friction": 0.10, "latency": 0.005}
EXACT_BOUND = 0.03
CLOCK_BOUND = 0.01  # [s]
LOSS_BOUND = 1.10  # Of the held-out loss to that at the truth.


@dataclasses.dataclass(frozen=True)
class Secret:
    """What a draw is made of; the clock error [s] is that of a repeat of "dynamic"."""

    fabric: Fabric
    clock_error: float
    repeat: int


def secret(draw: int) -> Secret:
    """The secret of a draw."""
    random = np.random.default_rng([20, draw])

    def between(low: float, high: float) -> float:
        return float(random.uniform(low, high))

    length = math.exp(between(*map(math.log, BENDING_LENGTH)))
    fabric = Fabric(
        density=DENSITY,
        thickness=unknowns.THICKNESS,
        bend_stiffness=DENSITY * GRAVITY * length**3,
        drag=between(*DRAG),
        added_mass=between(*ADDED_MASS),
        friction=between(*FRICTION),
        layer_friction=between(*FRICTION),
        stretch_stiffness=math.exp(between(*map(math.log, STRETCH))),
    )
    return Secret(fabric, between(*SLIP), int(random.integers(1, 3)))


def recipe(folder: pathlib.Path, draw: int, exact: bool) -> tuple:
    """The arguments of `synthetic.write_rags` for a draw."""
    drawn = secret(draw)
    share = 1.0 if exact else 0.5
    sensor = synthetic.Sensor(LATENCY, 0.0 if exact else NOISE)
    clock_errors = {(drawn.repeat, "dynamic"): drawn.clock_error}
    repeats = (0, 1, 2)
    return (
        folder,
        CLOTH,
        drawn.fabric,
        sensor,
        share * SPACING,
        share * STEP,
        repeats,
        clock_errors,
        draw,
    )


def read(folder: pathlib.Path) -> Task:
    """The recordings of a draw, as a search sees them: it knows the density and the camera."""
    base = Fabric(density=DENSITY, thickness=unknowns.THICKNESS)
    return read_task(folder, CLOTH, base, camera=CAMERA)


def result(draw: int, exact: bool, report: dict, task: Task) -> dict:
    """What was found beside what is true."""
    drawn = secret(draw)
    moved = motions(task, drawn.fabric)
    at_truth = {
        recording.name: float(recording.distances(moved[recording.scene], LATENCY).mean())
        for recording in task.recordings
    }
    off = f"{CLOTH}_{drawn.repeat}/dynamic"
    held_out = {n: row for n, row in report["held_out"]["recordings"].items() if n != off}
    least = np.mean([at_truth[name] for name in held_out])
    return {
        "draw": draw,
        "exact": exact,
        "truth": unknowns.values_of(drawn.fabric, LATENCY),
        "clock_error": {
            "name": off,
            "truth": drawn.clock_error,
            "found": report["clocks"][off]["clock_error"],
        },
        "clock_errors_found": [
            name for name, clock in report["clocks"].items() if clock["is_clock_off"]
        ],
        "loss_at_truth": at_truth,
        "held_out_ratio": float(np.mean([row["found"] for row in held_out.values()]) / least),
        **report,
    }


def run(
    draws: list[tuple[int, bool]],
    out: pathlib.Path,
    executor: Executor,
    seeds: int = SEEDS,
    evaluations: int = EVALUATIONS,
) -> None:
    """Makes the results of draws (number, whether exact) that are not there."""
    names = {key: f"{key[0]:02d}{'_exact' if key[1] else ''}" for key in draws}
    missing = [key for key in draws if not (out / f"{names[key]}.json").exists()]
    data = {key: out / "data" / names[key] for key in missing}
    written = [key for key in missing if not (data[key] / "written.json").exists()]
    calls = [recipe(data[key], *key) for key in written]
    for index, _ in executor.results(synthetic.write_rags, calls):
        write_json(data[written[index]] / "written.json", {})
        print(f"{names[written[index]]}: recordings", flush=True)
    tasks = {key: read(data[key]) for key in missing}
    fitted = {key: task.only_fitted() for key, task in tasks.items()}
    starts_found = executor.all(identify.make_start, [(fitted[key],) for key in missing])
    starts = dict(zip(missing, starts_found, strict=True))
    print("first looks", flush=True)
    searches, journals = {}, {}
    for key in missing:
        store = identify.open_store(out / "journals" / names[key], {"evaluations": evaluations})
        for seed in range(seeds):
            start = starts[key]
            searches[key, seed] = identify.make_search(tasks[key], start, seed, evaluations)
            journals[key, seed] = store.journal(seed)
    begin = time.time()

    def progress(best: dict) -> None:
        said = ", ".join(f"{names[k]}/{seed} {1e3 * v[1]:.2f}" for (k, seed), v in best.items())
        print(f"{time.time() - begin:.0f} s [mm]: {said}", flush=True)

    run_searches(
        searches, lambda k, *at: (fitted[k[0]], *at), evaluate, executor, journals, progress
    )
    calls = [
        (tasks[key], starts[key], [searches[key, seed].result() for seed in range(seeds)])
        for key in missing
    ]
    for index, found in executor.results(identify.report, calls):
        key = missing[index]
        write_json(out / f"{names[key]}.json", result(*key, found, tasks[key]))
        print(f"{names[key]}: done", flush=True)


def errors(found: dict) -> dict[str, float]:
    """How far what was found is off: relative, of latency [s]."""
    rows = {}
    for name, truth in found["truth"].items():
        value = found["parameters"][name]["value"]
        rows[name] = value - truth if name == unknowns.LATENCY else value / truth - 1.0
    return rows


def summary(results: list[dict]) -> dict:
    """How many draws are within bounds."""
    noisy = [found for found in results if not found["exact"]]
    exact = [found for found in results if found["exact"]]

    def near(found: dict, name: str, bound: float) -> bool:
        return abs(errors(found)[name]) <= bound

    def covered(found: dict, name: str) -> bool:
        entry = found["parameters"][name]
        return entry["low"] <= found["truth"][name] <= entry["high"]

    names = list(noisy[0]["truth"]) if noisy else []
    exact_bounds = {n: LATENCY * EXACT_BOUND if n == "latency" else EXACT_BOUND for n in BOUNDS}
    return {
        "draws": len(noisy),
        "within": {n: sum(near(f, n, b) for f in noisy) for n, b in BOUNDS.items()},
        "all_within": sum(all(near(f, n, b) for n, b in BOUNDS.items()) for f in noisy),
        "bounds": BOUNDS,
        "exact_bounds": exact_bounds,
        "clock_error_bound": CLOCK_BOUND,
        "loss_bound": LOSS_BOUND,
        "in_interval": {n: sum(covered(f, n) for f in noisy) for n in names},
        "not_identified": {n: sum(n in f["not_identified"] for f in noisy) for n in names},
        "clock_errors_found": sum(
            f["clock_errors_found"] == [f["clock_error"]["name"]]
            and abs(f["clock_error"]["found"] - f["clock_error"]["truth"]) <= CLOCK_BOUND
            for f in noisy
        ),
        "held_out": sum(f["held_out_ratio"] <= LOSS_BOUND for f in noisy),
        "exact_draws": len(exact),
        "exact_within": {n: sum(near(f, n, b) for f in exact) for n, b in exact_bounds.items()},
    }


def merge(folder: pathlib.Path, target: pathlib.Path) -> None:
    """Writes all results of a folder as one file, and prints how many are within bounds."""
    results = [read_json(file) for file in sorted(folder.glob("*.json"))]
    kept = [{**found, "errors": errors(found)} for found in results]
    write_json(target, {"summary": summary(results), "results": kept})
    for found in kept:
        shown = "  ".join(
            f"{name} {1e3 * e:+.1f} ms" if name == unknowns.LATENCY else f"{name} {100 * e:+.1f} %"
            for name, e in found["errors"].items()
        )
        print(f"{found['draw']:02d}{' exact' if found['exact'] else ''}: {shown}")
    print(json.dumps(summary(results), indent=2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, nargs="*", default=list(DRAWS))
    parser.add_argument("--exact", type=int, nargs="*", default=list(EXACT))
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("identification"))
    parser.add_argument("--merge", type=pathlib.Path, nargs=2, metavar=("FOLDER", "FILE"))
    arguments = parser.parse_args()
    if arguments.merge:
        merge(*arguments.merge)
        return
    keys = [(draw, False) for draw in arguments.draws] + [(d, True) for d in arguments.exact]
    with make_executor(arguments.jobs) as executor:
        run(keys, arguments.out, executor, arguments.seeds, arguments.evaluations)


if __name__ == "__main__":
    main()
