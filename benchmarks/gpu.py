"""What environments on a GPU do: rates, memory, and whether their bits are those of the CPU.

    python -m benchmarks.gpu --out docs/gpu.json
    python -m benchmarks.gpu --actor franka --tasks straighten_rope --parts rates --out franka.json

For one CUDA device. Each task starts from evaluation variations, one after the other, takes random
actions, and resets by itself, each environment in another step. Rates count env steps of all
environments: measures, rewards, infos and reduced observations are made in each; those of images
also an image of 128 x 128 pixels. The oracle of bits is the processor's kernel, whose own oracle
is the plugin (tests/cloth, tests/fluid, tests/vector).
"""

import argparse
import json
import os
import pathlib
import platform
import sys
import tempfile
import time
from typing import Any

import numpy as np
import torch

import softgym_mj
from softgym_mj.batch import gpu

EVALUATION = range(800, 1000)
NUMBERS, MAIN = (1, 16, 128, 256, 1056, 4096), 1056
PARTS = "compile_s", "rates", "images", "bits", "alone"
FEW = 32  # Variations of other numbers than the main one: each start takes time to read.
WARM_UP, STEPS, SECONDS = 3, 5, 1.0  # Env steps before the clock runs; at least; about.
# Environments whose bits are compared, env steps, and the side of their images [pixels].
BITS, BITS_STEPS, SIDE = 16, 3, 64


def machine() -> dict[str, Any]:
    """Where this runs."""
    driver = pathlib.Path("/proc/driver/nvidia/version")
    return {
        "gpu": torch.cuda.get_device_name(),
        "memory_gb": round(torch.cuda.get_device_properties(0).total_memory / 1e9, 1),
        "multiprocessors": torch.cuda.get_device_properties(0).multi_processor_count,
        "driver": driver.read_text().split("\n")[0].strip() if driver.exists() else "",
        "torch": torch.__version__,
        "cores": os.cpu_count(),
        "processor": platform.processor() or platform.machine(),
    }


def compile_times() -> dict[str, float]:
    """Seconds to compile each kernel, in a cache of its own."""
    before, found = os.environ.get("SOFTGYM_MJ_CACHE"), {}
    major, minor = torch.cuda.get_device_capability()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SOFTGYM_MJ_CACHE"] = folder
        for name in gpu.KERNELS:
            start = time.perf_counter()
            gpu.compiled(name, f"{major}{minor}")
            found[name] = round(time.perf_counter() - start, 1)
    if before is None:
        del os.environ["SOFTGYM_MJ_CACHE"]
    else:
        os.environ["SOFTGYM_MJ_CACHE"] = before
    return found


def variations(number: int, most: int) -> list[int]:
    """Of `number` environments: evaluation variations in turn."""
    return [EVALUATION[i % min(most, len(EVALUATION))] for i in range(number)]


def actions_of(envs: Any, steps: int) -> torch.Tensor:
    """Random actions (steps, num_envs, n) on the GPU, the same in every call."""
    shape = (steps, *envs.action_space.shape)
    numbers = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    return torch.from_numpy(numbers).cuda()


def rate(task: str, number: int, most: int, **settings: Any) -> dict[str, float]:
    """Env steps a second of a number of environments, and what they need."""
    torch.cuda.empty_cache()
    torch.cuda.reset_peak_memory_stats()
    split = EVALUATION[: min(number, most)]
    envs = softgym_mj.make_vec(task, number, device="cuda", split=split, **settings)
    options = {"variation": variations(number, most), "stagger": True}
    start = time.perf_counter()
    envs.reset(seed=0, options=options)
    torch.cuda.synchronize()
    first = time.perf_counter() - start
    again = []
    for _ in range(3):
        start = time.perf_counter()
        envs.reset(options=options)
        torch.cuda.synchronize()
        again.append(time.perf_counter() - start)
    actions = actions_of(envs, WARM_UP)
    for each in actions:
        envs.step(each)
    torch.cuda.synchronize()
    steps, ended, start = 0, torch.zeros((), device="cuda"), time.perf_counter()
    torch.cuda.set_sync_debug_mode("error")  # Nothing in a step waits for the GPU.
    while steps < STEPS or (time.perf_counter() - start < SECONDS and steps < 10 * STEPS):
        _, _, terminated, truncated, infos = envs.step(actions[steps % WARM_UP])
        ended += (terminated | truncated).sum()
        steps += 1
    torch.cuda.set_sync_debug_mode("default")
    torch.cuda.synchronize()
    seconds = time.perf_counter() - start
    flags = envs.backend._physics.flags
    found = {
        "env_steps_per_s": round(number * steps / seconds, 1),
        "ms_a_step": round(1e3 * seconds / steps, 3),
        "first_reset_s": round(first, 2),
        "reset_ms": round(1e3 * min(again), 1),
        "memory_gb": round(torch.cuda.max_memory_allocated() / 1e9, 2),
        "episodes_ended": int(ended),
        "flags": flags[flags != 0].tolist(),  # Flags of ClothBatchSolver or FluidBatchSolver.
        "mean_normalized_performance": round(float(infos["normalized_performance"].mean()), 4),
    }
    if "jax" in sys.modules:  # Arms; its memory is not PyTorch's.
        stats = sys.modules["jax"].devices("cuda")[0].memory_stats()
        found["jax_memory_gb"] = round(stats["peak_bytes_in_use"] / 1e9, 2)
    envs.close()
    return found


def played(
    task: str, number: int, device: str, times: int = 1, **settings: Any
) -> list[list[np.ndarray]]:
    """What the first rows are observed to be after each env step, and rewards: as many times."""
    settings |= {
        "observation": ["full", "reduced", "rgb", "depth", "segmentation"],
        "image_size": (SIDE, SIDE),
        "split": EVALUATION[:BITS],
    }
    envs = softgym_mj.make_vec(task, number, device=device, **settings)
    random = np.random.default_rng(1)
    actions = np.zeros((BITS_STEPS, *envs.action_space.shape), np.float32)
    actions[:, :BITS] = random.uniform(-1.0, 1.0, actions[:, :BITS].shape)
    actions[:, BITS:] = random.uniform(-1.0, 1.0, actions[:, BITS:].shape)
    found: list[list[np.ndarray]] = []
    for _ in range(times):
        envs.reset(options={"variation": variations(number, BITS)})
        found.append([])
        for each in actions:
            told = torch.from_numpy(each).cuda() if device == "cuda" else each
            seen, rewards, *_ = envs.step(told)
            arrays = [*seen.values(), rewards]
            host = [np.asarray(a.cpu() if device == "cuda" else a, float)[:BITS] for a in arrays]
            found[-1].append(np.concatenate([a.reshape(BITS, -1) for a in host], axis=1))
    envs.close()
    return found


def bits(task: str, **settings: Any) -> dict[str, Any]:
    """Whether a GPU's numbers are the processor's, its own of another run, and in other places."""
    first, again = played(task, BITS, "cuda", times=2, **settings)
    (among,) = played(task, 5 * BITS, "cuda", **settings)
    (host,) = played(task, BITS, "host", **settings)
    differences = [np.abs(a - b) for a, b in zip(first, host, strict=True)]
    return {
        "env_steps": BITS * BITS_STEPS,
        "same_in_another_run": all(map(np.array_equal, first, again)),
        "same_among_others": all(map(np.array_equal, first, among)),
        "of_processor_different_share": float(np.mean([(d > 0).mean() for d in differences])),
        "of_processor_largest_difference": float(max(d.max() for d in differences)),
    }


def alone(task: str, **settings: Any) -> bool:
    """Whether an environment that is not finite changes no other."""
    seen = []
    for spoilt in (False, True):
        settings |= {"observation": "full", "split": EVALUATION[:8]}
        envs = softgym_mj.make_vec(task, 8, device="cuda", **settings)
        envs.reset(options={"variation": variations(8, 8)})
        if spoilt:
            name = "qvel" if "qvel" in envs.backend._physics.state else "velocities"
            envs.backend._physics.state[name][3, 2] = torch.inf
        for each in actions_of(envs, 6):
            observations, *_ = envs.step(each)
        seen.append(np.delete(observations.cpu().numpy(), 3, axis=0))
        envs.close()
    return bool(np.array_equal(*seen))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=list(softgym_mj.TASKS))
    parser.add_argument("--numbers", nargs="+", type=int, default=NUMBERS)
    parser.add_argument("--variations", type=int, default=len(EVALUATION), help="of the main rate")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="measured anew")
    parser.add_argument("--actor", help="instead of the tasks' pickers and cups")
    parser.add_argument("--out", type=pathlib.Path, help="whose other parts stay")
    arguments = parser.parse_args()
    begun, parts = time.perf_counter(), arguments.parts
    actor = {"actor": arguments.actor} if arguments.actor else {}
    found: dict[str, Any] = {"machine": machine(), **actor, **{part: {} for part in PARTS}}
    if arguments.out and arguments.out.exists():
        before = json.loads(arguments.out.read_text())
        if before["machine"]["gpu"] != found["machine"]["gpu"]:
            parser.error(f"{arguments.out} is of a {before['machine']['gpu']}: name another file")
        if before.get("actor") != arguments.actor:
            parser.error(f"{arguments.out} is of actor {before.get('actor')}: name another file")
        found = before
    if "compile_s" in parts:
        found["compile_s"] = compile_times()
        print(json.dumps(found["compile_s"]), flush=True)
    for task in arguments.tasks:
        if "rates" in parts:
            own = found["rates"].setdefault(task, {})
            for number in arguments.numbers:
                most = arguments.variations if number == MAIN else FEW
                own[str(number)] = rate(task, number, most, **actor)
                print(task, number, own[str(number)], flush=True)
        if "images" in parts:
            found["images"][task] = {
                name: rate(task, MAIN, FEW, observation=observation, **actor)
                for name, observation in (("without", "reduced"), ("with", ["reduced", "rgb"]))
            }
            print(task, "images", found["images"][task], flush=True)
        if "bits" in parts:
            found["bits"][task] = bits(task, **actor)
            print(task, found["bits"][task], flush=True)
        if "alone" in parts:
            found["alone"][task] = alone(task, **actor)
        if parts == PARTS:
            found["seconds"] = round(time.perf_counter() - begun)
        print(f"{time.perf_counter() - begun:.0f} s", flush=True)
        if arguments.out:
            arguments.out.parent.mkdir(parents=True, exist_ok=True)
            arguments.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
