"""Commands for devices: kernels compiled ahead of time, env steps per second."""

import math
import time
from typing import Annotated, Any

import numpy as np
import typer

from softgym_mj.cli.console import Task, TaskSettings, console, parsed_settings
from softgym_mj.exceptions import UnavailableError, check_count, check_number
from softgym_mj.vector.make import DEVICES, make_vec

_WARM_UP = 3  # Env steps before measuring starts.


def compile_kernels(
    arch: Annotated[
        str | None, typer.Option(help="Architecture, such as 90 (H100); default: this GPU's.")
    ] = None,
) -> None:
    """Compiles GPU kernels ahead of their first use; needs no GPU."""
    from softgym_mj.batch import gpu

    if arch is None:
        import torch

        if not torch.cuda.is_available():
            raise UnavailableError("there is no CUDA device: name an architecture by --arch")
        arch = "".join(map(str, torch.cuda.get_device_capability()))
    for name in gpu.KERNELS:
        start = time.perf_counter()
        size = len(gpu.compiled(name, arch))
        console.print(
            f"{name} for sm_{arch}: {size / 1000:.0f} kB, {time.perf_counter() - start:.1f} s"
        )


def bench(
    task: Task,
    num_envs: Annotated[int, typer.Option(help="Number of environments.")] = 16,
    device: Annotated[str, typer.Option(help=f"Simulation device: {', '.join(DEVICES)}.")] = "cpu",
    seconds: Annotated[float, typer.Option(help="Approximate measuring time.")] = 5.0,
    task_settings: TaskSettings = "{}",
) -> None:
    """Measures env steps per second with random actions, including resets."""
    check_count("num_envs", num_envs, 1)
    check_number("seconds", seconds, ge=0.0, lt=math.inf)
    arguments: dict[str, Any] = {"split": "evaluate", **parsed_settings(task_settings)}
    envs = make_vec(task, num_envs, device=device, **arguments)
    random = np.random.default_rng(0)
    shape = (_WARM_UP, *(envs.action_space.shape or ()))
    actions: Any = random.uniform(-1.0, 1.0, shape).astype(np.float32)
    if device == "cuda":
        import torch

        actions = torch.from_numpy(actions).cuda()
    envs.reset(seed=0, options={"stagger": True})
    for each in actions:
        outcome = envs.step(each)
    steps, start = 0, _now(outcome)
    while time.perf_counter() - start < seconds or steps < 2:
        outcome = envs.step(actions[steps % _WARM_UP])
        steps += 1
    rate = steps * num_envs / (_now(outcome) - start)
    console.print(f"{task} on {device}: {num_envs} environments, {rate:.0f} env steps per second")
    envs.close()


def _now(outcome: Any) -> float:
    """Returns the time at which a device has finished an env step."""
    float(outcome[1].sum())  # Waits for the device.
    return time.perf_counter()
