"""What identification makes of recordings that another engine simulated: stock MuJoCo's flex.

    python -m benchmarks.identification_engines --folder build/identification_engines \\
        --out docs/identification_mujoco.json

A rag of a known fabric does both primitives: in stock MuJoCo, in whose air and in none, and in this
package's solver, for comparison. One camera sees it with 5 mm of noise, 33 ms late, three times.
Stock MuJoCo is told what makes small sheets of the same mesh measure as the fabric. It may be
stopped and run again: it goes on from the last generation of its searches.
"""

import argparse
import dataclasses
import functools
import logging
import math
import os
import pathlib
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # Before NumPy is loaded, here and in processes.

import mujoco
import numpy as np

from benchmarks.engines import calibration, motions, stock
from benchmarks.engines.mujoco_sheet import MujocoSheet
from benchmarks.engines.sheets import STEP, Engine, down
from softgym_mj.entities.sheet import Fabric
from softgym_mj.jobs.executors import Executor, make_executor
from softgym_mj.jobs.files import read_json, write_json
from softgym_mj.reality.identification import identify, synthetic, unknowns
from softgym_mj.reality.identification.rag_data import CAMERA, SIZE, SPACING, read_task, replayed
from softgym_mj.reality.identification.recordings import HELD_OUT
from softgym_mj.reality.identification.search import EVALUATIONS, loss
from softgym_mj.reality.identification.tasks import Task
from softgym_mj.reality.identification.tasks import motions as moved
from softgym_mj.reality.lab import theory
from softgym_mj.reality.meshes import rectangle

CLOTH = "linen"  # Whose name and numbers of frames the data have.
SENSOR = synthetic.Sensor(latency=0.033, noise=0.005)  # [s], [m]
SEEDS = 2
# Of recordings, the search's being 2.6 cm; with half of that stock MuJoCo's step does not converge.
FINE = SPACING / 1.5  # [m]
FALL = 300  # Steps in which a falling rag gets as fast as it will be.

# What a search knows: the density, and for the rest a tablecloth to start from.
KNOWN = dataclasses.replace(Fabric.named("white_dots"), density=0.2, thickness=unknowns.THICKNESS)
FABRIC = dataclasses.replace(
    KNOWN.bent(2.2e-5), stretch_stiffness=400.0, drag=1.4, friction=0.5, layer_friction=0.5
)
IN_AIR, IN_NONE, OURS = "mujoco in air", "mujoco", "ours"
CASES = (IN_AIR, IN_NONE, OURS)

Row = dict[str, Any]


def build(density: float, *arguments) -> MujocoSheet:
    """A sheet in stock MuJoCo, whose air has a density [kg/m^3], as `stock.build`."""
    sheet = stock.build(*arguments)
    sheet.model.opt.density = density
    return sheet


def engine(density: float) -> Engine:
    """Stock MuJoCo with air of a density [kg/m^3]."""
    return dataclasses.replace(stock.ENGINE, build=functools.partial(build, density))


def moved_by(made: Engine, mesh, fabric, hold, times, *, start, begin, floor, step) -> np.ndarray:
    """As of `rag_data.Simulate`, by an engine in its own steps: its floor is at 0."""
    table = np.array([0.0, 0.0, floor])
    lowered = dataclasses.replace(hold, path=lambda when: hold.path(when) - table)
    moments = {str(number): when for number, when in enumerate(times)}
    motion = motions.Motion(start - table, begin, (lowered,), moments)
    return motions.play(made, mesh, fabric, motion).positions + table


def drag(made: Engine, fabric: Fabric) -> float:
    """The coefficient of drag with which a flat rag falls as fast as it does in an engine."""
    mesh = rectangle(*SIZE, FINE)
    sheet = made.build(mesh, fabric, mesh.points, down(), False)
    nobody = np.zeros(0, int)
    sheet.hold(nobody)
    for _ in range(FALL):
        before = sheet.positions()
        sheet.step(np.zeros((0, 3)))
    speed = float((before - sheet.positions())[:, 2].mean()) / STEP
    sheet.close()
    return 2.0 * fabric.density * theory.GRAVITY / (theory.AIR_DENSITY * speed**2)


def mujoco_case(name: str) -> tuple[Row, Fabric, Engine]:
    """What stock MuJoCo is given, what it then measures as, and with what it does."""
    found = calibration.calibrate(stock.build, FABRIC, spacing=FINE)
    given = found.fabric(FABRIC)
    density = 0.0
    if name == IN_AIR:  # Drag is in proportion to it.
        density = theory.AIR_DENSITY * FABRIC.drag / drag(engine(theory.AIR_DENSITY), given)
    made = engine(density)
    measured = {key: dict(rounds)[found.given[key]] for key, rounds in found.measured.items()}
    truth = dataclasses.replace(
        FABRIC.bent(measured["bend_stiffness"]),
        stretch_stiffness=measured["stretch_stiffness"],
        friction=measured["friction"],
        layer_friction=measured["friction"],
        drag=drag(made, given) if name == IN_AIR else 0.0,
    )
    settings = {**stock.ENGINE.settings, "given": found.given, "air_density": density}
    return settings, truth, made


def record(name: str, folder: pathlib.Path) -> None:
    """Writes the recordings of a case, what is true of them, and with what they were made."""
    settings: Row = {}
    truth, given, simulate = FABRIC, FABRIC, replayed
    if name != OURS:
        settings, truth, made = mujoco_case(name)
        given = dataclasses.replace(FABRIC, **settings["given"])
        simulate = functools.partial(moved_by, made)
    synthetic.write_rags(
        folder, CLOTH, given, SENSOR, FINE, STEP / 2.0, seed=CASES.index(name), simulate=simulate
    )
    write_json(folder / "truth.json", {"fabric": dataclasses.asdict(truth), "settings": settings})


def run(name: str, folder: pathlib.Path, seeds: int, evaluations: int, executor: Executor) -> Row:
    """What is found in the recordings of a case, beside what is true."""
    data = folder / "data" / name.replace(" ", "_")
    if not (data / "truth.json").exists():
        record(name, data)
        print(f"{name}: recordings", flush=True)
    written = read_json(data / "truth.json")
    truth = Fabric(**written["fabric"])
    task = read_task(data, CLOTH, KNOWN, camera=CAMERA)
    store = identify.open_store(folder / "searches" / name.replace(" ", "_"), {"case": name})

    def progress(best: dict) -> None:
        said = ", ".join(f"{made}: {1e3 * least:.2f}" for made, least in best.values())
        print(f"{name} [mm] after {said}", flush=True)

    found = identify.identify(task, executor, tuple(range(seeds)), evaluations, store, progress)
    return {
        "case": name,
        "truth": true_values(truth),
        "settings": written["settings"],
        "at_truth": at_truth(task, truth),
        "bias": bias(true_values(truth), found["parameters"]),
        **found,
    }


def at_truth(task: Task, truth: Fabric) -> dict[str, float]:
    """At true numbers [m]: what a search looks at ("loss"), mean distances of both roles."""
    there = moved(task, truth)
    fitted, held_out = (
        [float(r.distances(there[r.scene], SENSOR.latency).mean()) for r in some]
        for some in (task.fitted, [r for r in task.recordings if r.role == HELD_OUT])
    )
    offsets = [r.offsets(there[r.scene], SENSOR.latency).ravel() for r in task.fitted]
    return {
        "loss": loss(np.concatenate(offsets)),
        "fit": float(np.mean(fitted)),
        "held_out": float(np.mean(held_out)),
    }


def true_values(fabric: Fabric) -> dict[str, float]:
    """The numbers that are looked for, by name; those of air may be 0."""
    air = {"drag": fabric.drag, "added_mass": fabric.added_mass}
    shares = {name: value / fabric.density for name, value in air.items()}
    return {**unknowns.values_of(fabric, SENSOR.latency), **shares}


def bias(truth: dict[str, float], parameters: Row) -> dict[str, float | None]:
    """By which share each number is off, of latency [s]; None of what is truly 0."""
    off: dict[str, float | None] = {}
    for name, true in truth.items():
        value = parameters[name]["value"]
        if name == unknowns.LATENCY:
            off[name] = value - true
        else:
            off[name] = None if math.isclose(true, 0.0) else value / true - 1.0
    return off


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=pathlib.Path, default="build/identification_engines")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    logging.getLogger("absl").setLevel(logging.ERROR)  # Of flexes that are stiff.
    with make_executor(arguments.jobs) as executor:
        rows = [
            run(name, arguments.folder, arguments.seeds, arguments.evaluations, executor)
            for name in arguments.cases
        ]
    if arguments.out:
        result = {
            "mujoco": mujoco.__version__,
            "fabric": dataclasses.asdict(FABRIC),
            "spacing_m": {"recordings": FINE, "searches": SPACING},
            "cases": rows,
        }
        write_json(arguments.out, result)


if __name__ == "__main__":
    main()
