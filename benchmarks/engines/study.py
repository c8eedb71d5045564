"""How far apart engines are that simulate the same fabric, and how far ours is from itself.

Each engine is calibrated, then moves the same mesh: `motions`. Beside it, ours with every number of
the fabric 10 % up and down, half the step, a mesh twice as fine, and a start that is shaken by
0.1 mm. Distances are root mean squares over corresponding vertices.

    pip install -e .[engines]
    python -m benchmarks.engines.study --folder build/engines --out docs/engines.json

It may be stopped and goes on where it was. `--engines` and `--cases` choose what is played; the
file holds the cases that all engines have played. `make sheets` writes tables and figures.
"""

import argparse
import dataclasses
import importlib
import itertools
import json
import logging
import pathlib
import platform
from collections.abc import Callable

import numpy as np

from benchmarks.engines import motions, ours
from benchmarks.engines.calibration import OTHER_LOAD, SAME, Calibration, bending, calibrate
from benchmarks.engines.sheets import FABRIC, SHEET, SIDE, SPACING, Engine
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.entities.sheet import Fabric
from softgym_mj.jobs.store import ARRAYS, JSON, Store
from softgym_mj.reality.meshes import Mesh, rectangle

# By name: module and attribute, as most of them may not be installed.
ENGINES: dict[str, tuple[str, str]] = {
    "mujoco": ("benchmarks.engines.stock", "ENGINE"),
    "bullet": ("benchmarks.engines.bullet", "ENGINE"),
    "style3d": ("benchmarks.engines.newton_sheet", "STYLE3D"),
    "vbd": ("benchmarks.engines.newton_sheet", "VBD"),
}
# The floor holds VBD's sheets at any slope, and its stretch does not converge: it is calibrated,
# which says so, and not compared.
COMPARED = ("ours", "mujoco", "bullet", "style3d")

CHANGE = 0.1  # Share by which numbers are changed.
CHANGED = (
    "stretch_stiffness", "bend_stiffness", "shear", "stretch_damping", "bend_damping", "density",
    "thickness", "friction", "layer_friction",
)  # fmt: skip
NOISE = 1e-4  # [m] Standard deviation of the start.
SHOWN = {"dynamic": "lowered", "folded 0": "release"}  # Cases whose vertices are kept.


def engine(name: str) -> Engine:
    """One of "ours" and `ENGINES`.

    Raises:
        ModuleNotFoundError: if it is not installed.
    """
    if name == "ours":
        return ours.engine()
    module, attribute = ENGINES[name]
    return getattr(importlib.import_module(module), attribute)


def variations() -> list[str]:
    """Names of ours and of what is changed of it; the first is as it is."""
    changed = [f"{name} {sign}10 %" for name in CHANGED for sign in "+-"]
    return ["nominal", *changed, "half step", "double mesh", "noise"]


def setting(variation: str, fabric: Fabric) -> tuple[Engine, Fabric, Mesh, int]:
    """Engine, fabric, mesh and cells of that in one of `SHEET`, of a variation."""
    if variation == "half step":
        return ours.engine(ours.STEP / 2), fabric, SHEET, 1
    if variation == "double mesh":
        side = (SIDE - 1) * SPACING
        return ours.engine(), fabric, rectangle(side, side, SPACING / 2), 2
    if variation.endswith("10 %"):
        name, change = variation.split(" ", 1)
        factor = 1.0 + CHANGE if change.startswith("+") else 1.0 - CHANGE
        number = factor * getattr(fabric, name)
        return ours.engine(), dataclasses.replace(fabric, **{name: number}), SHEET, 1
    return ours.engine(), fabric, SHEET, 1


def played(made: Engine, fabric: Fabric, mesh: Mesh, every: int, case: str, noise: float = 0.0):
    """What an engine makes of a case: arrays by name.

    `positions` (moments, vertices of `SHEET`, 3) [m], `strain_99`, `lowest` [m], `milliseconds` of
    CPU for 10 ms, `failed`, and `intersections` (moments,).
    """
    motion = motions.motion(case, mesh, every)
    if noise:
        random = np.random.default_rng(0).normal(0.0, noise, motion.start.shape)
        motion = dataclasses.replace(motion, start=motion.start + random)
    replay = motions.play(made, mesh, fabric, motion)
    hits = [
        count_intersections(points, mesh.edges, mesh.triangles) if np.isfinite(points).all() else -1
        for points in replay.positions
    ]
    return {
        "positions": replay.positions[:, motions.coarse(every)],
        "strain_99": np.array(replay.strain_99),
        "lowest": np.array(replay.lowest),
        "milliseconds": np.array(replay.milliseconds),
        "failed": np.array([failure.kind for failure in replay.failures], dtype="U20"),
        "intersections": np.array(hits),
    }


def distance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Root mean square distance [mm] of vertices (..., n, 3) [m]: (...)."""
    return 1e3 * np.sqrt(((first - second) ** 2).sum(axis=-1).mean(axis=-1))


def root_mean_square(values) -> float:
    """Of numbers."""
    return float(np.sqrt(np.mean(np.square(list(values)))))


def spread(runs: dict[str, np.ndarray]) -> np.ndarray:
    """Root mean square (moments,) [mm] of the distances of all pairs of runs (moments, n, 3)."""
    pairs = [distance(a, b) for a, b in itertools.combinations(runs.values(), 2)]
    return np.sqrt(np.mean(np.square(pairs), axis=0))


Runs = dict[str, dict[str, dict[str, np.ndarray]]]  # By run and case.


def summary(calibrations: dict[str, Calibration], engines: Runs, own: Runs) -> dict:
    """The result file."""
    cases = [c for c in motions.names() if all(c in engines.get(e, {}) for e in COMPARED)]
    cases = [case for case in cases if all(case in own[v] for v in own)]
    result: dict = {
        "machine": platform.processor() or platform.machine(),
        "fabric": dataclasses.asdict(FABRIC),
        "engines": {
            name: {"title": made.title, "settings": made.settings}
            for name in calibrations
            for made in [engine(name)]
        },
        "calibration": {name: dataclasses.asdict(c) for name, c in calibrations.items()},
        "cases": {case: list(motions.motion(case, SHEET).moments) for case in cases},
        "between": {
            f"{a} {b}": {
                case: distance(engines[a][case]["positions"], engines[b][case]["positions"])
                for case in cases
            }
            for a, b in itertools.combinations(COMPARED, 2)
        },
        "between_all": {
            case: spread({name: engines[name][case]["positions"] for name in COMPARED})
            for case in cases
        },
        "own": {
            variation: {
                case: distance(runs[case]["positions"], own["nominal"][case]["positions"])
                for case in cases
            }
            for variation, runs in own.items()
            if variation != "nominal"
        },
        "own_all": {
            case: spread({name: runs[case]["positions"] for name, runs in own.items()})
            for case in cases
        },
        "runs": {
            name: {
                case: {
                    "strain_99": run["strain_99"],
                    "lowest": run["lowest"],
                    "milliseconds": run["milliseconds"],
                    "failed": run["failed"],
                    "intersections": run["intersections"],
                }
                for case, run in runs.items()
            }
            for name, runs in engines.items()
        },
        "shown": {
            case: {
                name: engines[name][case]["positions"][
                    list(motions.motion(case, SHEET).moments).index(moment)
                ].round(3)
                for name in COMPARED
            }
            for case, moment in SHOWN.items()
            if case in cases
        },
    }
    return json.loads(json.dumps(result, default=lambda value: np.asarray(value).tolist()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=pathlib.Path, default="build/engines")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--engines", nargs="+", default=[*COMPARED, "vbd"])
    parser.add_argument("--cases", nargs="+", default=motions.names())
    arguments = parser.parse_args()
    logging.getLogger("absl").setLevel(logging.ERROR)  # Of flexes that are stiff.
    calibrations, engines, own = {}, {}, {}
    for name in arguments.engines:
        made = engine(name)
        calibration = calibrated(arguments.folder, made)
        calibrations[name] = calibration
        if name not in COMPARED:
            continue
        fabric = calibration.fabric()
        specification = {"given": calibration.given, "settings": made.settings, "version": 1}
        runs = Store(arguments.folder / name, specification, ARRAYS)
        if name == "ours":
            for variation in variations():
                setup = setting(variation, fabric)
                noise = NOISE if variation == "noise" else 0.0
                own[variation] = results(
                    runs, variation.replace(" ", "-").replace("%", "percent"), arguments.cases,
                    lambda case, setup=setup, noise=noise: played(*setup, case, noise),
                )  # fmt: skip
            engines[name] = own["nominal"]
        else:
            engines[name] = results(
                runs, "nominal", arguments.cases,
                lambda case, made=made, fabric=fabric: played(made, fabric, SHEET, 1, case),
            )  # fmt: skip
    if arguments.out:
        arguments.out.write_text(json.dumps(summary(calibrations, engines, own)) + "\n")


def calibrated(folder: pathlib.Path, made: Engine) -> Calibration:
    """An engine's calibration, made once.

    Where what its beam measures hangs by how it starts, bending stays what the fabric says.
    """
    specification = {"settings": made.settings, "fabric": dataclasses.asdict(FABRIC), "version": 1}
    store = Store(folder / "calibration" / made.name, specification, JSON)
    rounds = {} if made.name in COMPARED else {"rounds": 1}
    store.run(
        ["calibration"],
        lambda key: dataclasses.asdict(calibrate(made.build, **rounds)),
        progress=lambda key, value: print(made.name, value, flush=True),
    )
    found = Calibration(**store.get("calibration"))
    # A beam that hardly moves measures as whatever it started as.
    store.run(["restarted"], lambda key: bending(made.build, found.fabric(), start=OTHER_LOAD))
    restarted = store.get("restarted")
    given = next(
        value
        for number, value in found.measured["bend_stiffness"]
        if number == found.given["bend_stiffness"]
    )
    if abs(restarted / given - 1.0) > SAME:
        own = {**found.given, "bend_stiffness": FABRIC.bend_stiffness}
        found = dataclasses.replace(found, given=own)
    return dataclasses.replace(found, restarted=restarted)


def results(
    store: Store, run: str, cases: list[str], play: Callable[[str], dict[str, np.ndarray]]
) -> dict[str, dict[str, np.ndarray]]:
    """Runs by case, of which those that are missing are played."""
    keys = {(run, case.replace(" ", "-")): case for case in cases}
    found = {}

    def note(key, value):
        found[keys[key]] = value
        print(store.folder.name, *key, f"{value['milliseconds']:.1f} ms", flush=True)

    store.run(keys, lambda run, case: play(keys[run, case]), progress=note)
    return {case: found[case] for case in cases}


if __name__ == "__main__":
    main()
