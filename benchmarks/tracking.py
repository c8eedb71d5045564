"""How well the arms follow Cartesian commands, and what their inverse kinematics costs.

One arm follows minimum-jerk ways between random points and a Lissajous curve at up to 0.6 m/s, and
random actions at full range that change every 0.08 s, with the physics step and the solver of a
cloth and of a rope that lie out of reach. Distances in mm, mean / 95 % / largest: of the tool from
the reference that the joints are led along, and of the tool from the command, which the reference
follows as its limits of speed and acceleration let it.

    python -m benchmarks.tracking --seconds 20 --out new.json
"""

import argparse
import itertools
import json
import pathlib
import platform
import time

import mujoco
import numpy as np

from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.base import SIM_STEP
from tests.scenes.arm_paths import WORKSPACE, lissajous, scene, waypoints

REPEAT = 8  # Sim steps of a random action.
SOLUTIONS = 500  # Timed for the cost of one.


def random(steps: int) -> np.ndarray:
    """Displacements (steps, 3) [1] that change every `REPEAT` sim steps."""
    actions = np.random.default_rng(0).uniform(-1, 1, (steps // REPEAT + 1, 3))
    return np.repeat(actions, REPEAT, axis=0)[:steps]


def summary(distances: list[float]) -> list[float]:
    """Mean, 95 % quantile and largest [mm]."""
    return [1000 * float(f(distances)) for f in (np.mean, lambda d: np.quantile(d, 0.95), np.max)]


def track(kind: str, arm: str, motion: str, seconds: float) -> dict[str, object]:
    """Distances of one motion."""
    model, data, arms = scene(kind, arm)
    steps = round(seconds / SIM_STEP)
    base = arms.mounts[0].base
    path = {"waypoints": waypoints, "lissajous": lissajous, "random": random}[motion](steps)
    if motion != "random":  # From the arm's frame, which faces +Y.
        path = np.column_stack([-path[:, 1], path[:, 0], path[:, 2]]) + base
    start = path[0] if motion != "random" else base + np.array([0.0, 0.45, 0.2])
    arms.place(start[None], WORKSPACE)
    mujoco.mj_forward(model, data)
    physics_steps = round(SIM_STEP / model.opt.timestep)
    to_reference, to_command = [], []
    for row in path:
        way = row if motion == "random" else (row - arms.commanded_positions()[0]) / SIM_STEP
        arms.command(np.append(np.clip(way, -1, 1), -1.0))
        arms.plan()
        for i in range(physics_steps):
            arms.move((i + 1) / physics_steps, model.opt.timestep)
            mujoco.mj_step(model, data)
        tool = arms.positions()
        to_reference.append(np.linalg.norm(tool - arms.reference_positions()))
        to_command.append(np.linalg.norm(tool - arms.commanded_positions()))
    return {
        "to_reference_mm": summary(to_reference),
        "to_command_mm": summary(to_command),
        "ik_failures": arms.diagnostics()["ik_failures"],
    }


def solution_ms(arm: str, number: int) -> float:
    """Median time of one solution of the controller, which is needed every 0.02 s [ms]."""
    _, _, arms = scene("rope", arm, number)
    start = arms.default_positions(np.array([0.0, 0.0, 0.2]))
    arms.place(start, WORKSPACE)
    controller, times = arms.controller, []
    for i in range(SOLUTIONS):
        points = start + 0.1 * np.sin(0.06 * i) * np.array([1.0, 0.0, 0.5])
        begin = time.perf_counter()
        controller.follow(points)
        times.append(time.perf_counter() - begin)
    return 1000 * float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=ARMS)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    results: dict[str, dict] = {}
    for arm in arguments.arms:
        results[arm] = {f"solution_ms_{n}_arms": solution_ms(arm, n) for n in (1, 2)}
        print(arm, {name: round(value, 3) for name, value in results[arm].items()}, flush=True)
        for kind, motion in itertools.product(
            ("cloth", "rope"), ("waypoints", "lissajous", "random")
        ):
            row = track(kind, arm, motion, arguments.seconds)
            results[arm][f"{kind}_{motion}"] = row
            print(f"{arm:7} {kind:6} {motion:10}", end=" ")
            for name in ("to_reference_mm", "to_command_mm"):
                print(f"{name} {' / '.join(f'{value:.1f}' for value in row[name]):18}", end=" ")
            print(f"ik_failures {row['ik_failures']}", flush=True)
    if arguments.out:
        machine = {"processor": platform.processor(), "mujoco": mujoco.__version__}
        arguments.out.write_text(json.dumps({"machine": machine, "arms": results}, indent=2))


if __name__ == "__main__":
    main()
