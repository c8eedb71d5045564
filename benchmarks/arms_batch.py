"""Rates of arms in batches, without what they handle, and what their steps cost.

    python -m benchmarks.arms_batch --device gpu --out arms_batch.json

Arms start as in an episode of `straighten_rope` and take random actions. Besides env steps of eight
sim steps, a solution of the inverse kinematics (four in an env step) and a physics step (eight) are
measured alone. `--check` compares a few env steps with those of the processor.
"""

import argparse
import functools
import json
import os
import pathlib
import platform
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

import softgym_mj
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm_batch import chain, dynamics, inverse_kinematics, models
from softgym_mj.robots.arm_batch.arms import ArmBatch
from softgym_mj.robots.arm_batch.state import read_state
from softgym_mj.robots.base import SIM_STEP

SIM_STEPS = 8  # In an env step.
LEAST, SECONDS = 5, 1.0  # Calls before the clock stops: at least; about.
CHECKED, CHECKED_STEPS = 16, 10  # Environments and env steps of `--check`.


def started(arm: str, number: int) -> tuple[ArmBatch, dict[str, np.ndarray]]:
    """Returns a batch of as many arms of a kind, and a row of its state."""
    env = softgym_mj.load("straighten_rope", actor=arm, arms=number)
    env.reset(800)
    batch = ArmBatch.of(env.task.actor, env.physics.model.opt.timestep)
    return batch, read_state(env.task.actor)


def milliseconds(call: Callable[[], Any]) -> float:
    """Returns the time of a call that has been compiled."""
    jax.block_until_ready(call())
    count, start = 0, time.perf_counter()
    while count < LEAST or time.perf_counter() - start < SECONDS:
        result = call()
        count += 1
        if count % LEAST == 0:
            jax.block_until_ready(result)
    jax.block_until_ready(result)
    return 1e3 * (time.perf_counter() - start) / count


def rates(
    arm: str, batch: ArmBatch, row: dict[str, np.ndarray], number: int, device: jax.Device
) -> dict[str, float]:
    """Measures a number of environments."""
    state = batch.stack([row] * number, device)
    count = 4 * state.reference.shape[1]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (20, number, count))
    start = time.perf_counter()
    jax.block_until_ready(batch.step(state, actions[0], SIM_STEPS))
    compiling = time.perf_counter() - start
    for action in actions:  # From here on, arms move at all speeds.
        state, _ = batch.step(state, action, SIM_STEPS)
    whole = milliseconds(lambda: batch.step(state, actions[-1], SIM_STEPS))
    with jax.enable_x64(True):
        model, _ = models.dynamic_model(ARMS[arm], SIM_STEP)
        own = dynamics.dynamics_of(model)

        def each(angles, *rest):
            return dynamics.step(own, chain.poses(own.chain, angles), angles, *rest)[:2]

        moves = jax.jit(jax.vmap(jax.vmap(each)))
        physics = milliseconds(lambda: moves(state.positions, state.speeds, state.positions))
        follow = jax.jit(jax.vmap(functools.partial(inverse_kinematics.follow, batch.kinematics)))
        goals = state.filter.points
        solution = milliseconds(lambda: follow(state.reference, goals))
    return {
        "num_envs": number,
        "env_steps_per_s": round(1e3 * number / whole, 1),
        "env_step_ms": round(whole, 3),
        "inverse_kinematics_ms": round(solution, 3),
        "physics_step_ms": round(physics, 3),
        "compile_s": round(compiling, 1),
    }


def check(batch: ArmBatch, row: dict[str, np.ndarray], device: jax.Device) -> dict[str, Any]:
    """Compares tool points with those of the processor and of another run."""
    found = []
    for place in (device, device, jax.devices("cpu")[0]):
        state, points = batch.stack([row] * CHECKED, place), []
        count = 4 * state.reference.shape[1]
        random = np.random.default_rng(1)
        for _ in range(CHECKED_STEPS):
            action = random.uniform(-1.0, 1.0, (CHECKED, count))
            state, motion = batch.step(state, action, SIM_STEPS)
            points.append(np.asarray(motion.points))
        found.append(np.concatenate(points))
    return {
        "same_in_another_run": bool(np.array_equal(found[0], found[1])),
        "largest_difference_from_processor_m": float(np.abs(found[0] - found[2]).max()),
    }


def main() -> None:
    """Runs the measurements of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--device", default="cpu", help="platform of JAX: cpu or gpu")
    parser.add_argument("--arm", default="franka", choices=sorted(ARMS))
    parser.add_argument("--arms", type=int, default=2, choices=(1, 2))
    parser.add_argument("--number", type=int, nargs="+", default=[4, 64])
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--out", type=pathlib.Path)
    options = parser.parse_args()
    device = jax.devices(options.device)[0]
    batch, row = started(options.arm, options.arms)
    found: dict[str, Any] = {
        "device": device.device_kind,
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "jax": jax.__version__,
        "arm": options.arm,
        "arms": options.arms,
        "rates": [],
    }
    for number in options.number:
        found["rates"].append(rates(options.arm, batch, row, number, device))
        print(found["rates"][-1], flush=True)
    if options.check:
        found["check"] = check(batch, row, device)
        print(found["check"])
    if options.out:
        options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
