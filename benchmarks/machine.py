"""The machine that benchmarks run on."""

import contextlib
import os
import pathlib
import platform
import time
from typing import Any

import mujoco
import numpy as np
from dm_control import suite

STEPS = 1500


def machine() -> dict[str, Any]:
    """What this runs on."""
    processor = platform.processor()
    with contextlib.suppress(OSError):
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":")[1].strip() for line in lines if "model name" in line)
    return {"processor": processor, "cores": os.cpu_count(), "system": platform.platform(),
            "load_average": os.getloadavg()[0]}  # fmt: skip


def yardstick() -> float:
    """Speed [mj_steps/s] of dm_control's humanoid, which moves at random, on one core."""
    physics = suite.load("humanoid", "stand", task_kwargs={"random": 0}).physics
    model, data = physics.model.ptr, physics.data.ptr
    controls = np.random.default_rng(0).uniform(-1, 1, (STEPS, model.nu))
    start = time.thread_time()
    for control in controls:
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
    return STEPS / (time.thread_time() - start)
