"""The same cloth in Newton, MuJoCo Warp and softgym_mj: rates, memory, strain, and penetration.

    python -m benchmarks.peers --out docs/peers.json
    python -m benchmarks.peers --device cpu --sizes 9x5 --num-envs 1 --out cpu.json

A cloth hangs from two corners, is released after 0.5 s, falls and crumples on the floor; 2 s in all
(`Scene`). Mesh, mass, thickness, stretch and bending stiffness, damping ratios and friction are the
same; solver settings are those that each simulator's own cloth examples have (docstrings of the
modules here). All are measured by the same functions of positions. A timed step has 10 ms, which a
simulator divides into its own substeps; compilation, starts and measures are not timed. Each case
runs in a process of its own: its failure is a result.
"""

import argparse
import functools
import importlib
import itertools
import json
import math
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

from benchmarks.peers.scene import DURATION, HOLD, STEP, Scene, Simulation

NUMBERS = 1, 128, 1056
# Vertices: the cloth of fold_cloth, which hangs from a short side, and a larger one.
SIZES = "21x13", "41x41"
# Modules, classes, and arguments of simulators. MuJoCo Warp and Newton are imported only in their
# own processes.
SIMULATORS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "softgym_mj": ("softgym_cloth", "SoftGymCloth", {}),
    "newton": ("newton_vbd", "NewtonVbd", {}),
    "newton_4_iterations": ("newton_vbd", "NewtonVbd", {"iterations": 4}),
    "mujoco_warp": ("mujoco_warp_flex", "MujocoWarpFlex", {}),
}
MEASURED, CLOSE = 32, 8  # Environments whose strains, and whose gaps, are measured.
EVERY = 5  # Steps between measures of strain.
LONGEST = 900.0  # [s] Time limit of a process, which includes compilation.


def built(simulator: str, scene: Scene, num_envs: int, device: str) -> Simulation:
    """Returns a simulator with environments at the start."""
    module, name, settings = SIMULATORS[simulator]
    found = getattr(importlib.import_module(f"benchmarks.peers.{module}"), name)
    return found(scene, num_envs, device, **settings)


def played(simulation: Simulation, scene: Scene, num_envs: int, seconds: float) -> dict[str, Any]:
    """Returns rates and measures of the motion, which ends early after `seconds` of timed steps."""
    times: list[float] = []
    strains, lowest = [], math.inf
    measured = min(num_envs, MEASURED)
    while len(times) < round(DURATION / STEP) and sum(times) < seconds:
        if len(times) == round(HOLD / STEP):
            simulation.release()
        before = simulation.positions(measured)
        start = time.perf_counter()
        simulation.step()
        simulation.wait()
        times.append(time.perf_counter() - start)
        points = simulation.positions(measured)
        if not np.isfinite(points).all():
            raise FloatingPointError(f"positions are not finite after {len(times)} steps")
        lowest = min(lowest, points[..., 2].min())
        if len(times) % EVERY == 1:
            strains.append(np.abs(scene.strains(points)))
    thickness, steps = scene.fabric.thickness, len(times)
    gaps = [scene.smallest_gap(each) for each in points[:CLOSE]]
    speed = math.sqrt((((points - before) / STEP) ** 2).sum(axis=-1).mean())
    rate = num_envs * steps / sum(times)
    return {
        "simulated_s": round(steps * STEP, 2),
        "wall_s_per_simulated_s": sum(times) / (steps * STEP),
        "steps_per_s": rate,
        "substeps_per_s": rate * simulation.substeps,
        "vertex_substeps_per_s": rate * simulation.substeps * scene.num_points,
        "times_real_time": rate * STEP,
        "median_step_ms": 1e3 * float(np.median(times)),
        "p95_step_ms": 1e3 * float(np.quantile(times, 0.95)),
        "memory_gb": simulation.peak_memory(),
        "largest_strain": float(np.max(strains)),
        "mean_strain": float(np.mean(strains)),
        "smallest_gap_in_thicknesses": min(gaps) / thickness if np.isfinite(min(gaps)) else None,
        "intersections": sum(scene.intersections(each) for each in points[:CLOSE]) / len(gaps),
        "floor_penetration_mm": 1e3 * max(thickness / 2.0 - lowest, 0.0),
        "final_speed_mm_per_s": 1e3 * speed,
        "final_mean_height_mm": 1e3 * points[..., 2].mean(),
        "problems": simulation.problems(),
    }


def scene_of(size: str) -> Scene:
    """Returns the scene of a cloth of "ROWSxCOLUMNS" vertices."""
    rows, columns = map(int, size.split("x"))
    return Scene(rows, columns)


def case(simulator: str, size: str, num_envs: int, device: str, seconds: float) -> dict[str, Any]:
    """Returns the results of a case, in this process."""
    scene, start = scene_of(size), time.perf_counter()
    simulation = built(simulator, scene, num_envs, device)
    simulation.wait()
    setup = time.perf_counter() - start
    numbers = {"setup_s": setup, **played(simulation, scene, num_envs, seconds)}
    used = gpu("memory.used")
    numbers["device_memory_gb"] = float(used.split()[0]) * 2**20 / 1e9 if used else None
    rounded = {k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in numbers.items()}
    own = {"vertices": scene.num_points, "substeps": simulation.substeps}
    return {**own, **rounded, "settings": simulation.settings}


run = functools.partial(subprocess.run, check=False, capture_output=True, text=True)


def in_process(arguments: list[str]) -> dict[str, Any]:
    """Returns the results of a case from a process of its own, or why there are none."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder, "case.json")
        command = [sys.executable, "-m", "benchmarks.peers", "--case", *arguments, "--out", out]
        try:
            done = run(command, timeout=LONGEST)
        except subprocess.TimeoutExpired:
            return {"error": f"no result after {LONGEST:.0f} s"}
        if done.returncode:
            last = done.stderr.strip().splitlines()[-3:]
            return {"error": "\n".join([f"exit status {done.returncode}", *last])}
        return json.loads(out.read_text())


def gpu(query: str) -> str:
    """Returns an answer of nvidia-smi, or "" without it."""
    command = ["nvidia-smi", f"--query-gpu={query}", "--format=csv,noheader"]
    return run(command).stdout.strip() if shutil.which(command[0]) else ""


def machine() -> dict[str, Any]:
    """Where this runs."""
    return {
        "gpu": gpu("name,memory.total,driver_version"),
        "cores": os.cpu_count(),
        "processor": platform.processor() or platform.machine(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulators", nargs="+", choices=SIMULATORS, default=list(SIMULATORS))
    parser.add_argument("--sizes", nargs="+", default=SIZES, help="ROWSxCOLUMNS vertices")
    parser.add_argument("--num-envs", nargs="+", type=int, default=NUMBERS)
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda")
    parser.add_argument("--seconds", type=float, default=8.0, help="of timed steps of a case")
    parser.add_argument("--case", action="store_true", help="one, in this process")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="whose other cases stay")
    told = parser.parse_args()
    if told.case:
        (name,), (size,), (num_envs,) = told.simulators, told.sizes, told.num_envs
        found = case(name, size, num_envs, told.device, told.seconds)
        told.out.write_text(json.dumps(found))
        return
    found = {"machine": machine(), "cases": {}}
    if told.out.exists():
        before = json.loads(told.out.read_text())
        if before["machine"] != found["machine"]:
            parser.error(f"{told.out} is of {before['machine']}: name another file")
        found = before
    for size, num_envs, name in itertools.product(told.sizes, told.num_envs, told.simulators):
        case_of = ["--simulators", name, "--sizes", size, "--num-envs", str(num_envs)]
        limits = ["--device", told.device, "--seconds", str(told.seconds)]
        own = found["cases"].setdefault(size, {}).setdefault(str(num_envs), {})
        own[name] = in_process([*case_of, *limits])
        print(size, num_envs, name, own[name], flush=True)
        told.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
