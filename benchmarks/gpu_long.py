"""What takes long on a GPU: decisions of a planner, and many env steps in a row.

    python -m benchmarks.gpu_long planner --out docs/gpu_planner.json
    python -m benchmarks.gpu_long steps --out docs/gpu_steps.json

For one CUDA device. A planner tries 21,000 env steps for a decision, the paper's budget. Random
actions go on for ten million env steps of all tasks together, or as long as there is time: rate and
memory are noted in each of ten parts.
"""

import argparse
import json
import pathlib
import time
from typing import Any

import numpy as np
import torch

import softgym_mj
from softgym_mj.policies.model_predictive import ModelPredictivePolicy
from softgym_mj.policies.planners import BUDGET, Plan, make_planner
from softgym_mj.registry import find
from softgym_mj.vector.batch.rollouts import DeviceRollouts

DECISIONS = {"straighten_rope": 10, "fold_cloth": 10, "transport_water": 10}
VARIATION = 800
# Env steps of each task, ten million in all: of those that are quick, more. Parts are whole vector
# steps, which leaves some out. They take four minutes on an H100.
STEPS = {
    **dict.fromkeys(("straighten_rope", "rope_configuration"), 4_100_000),
    **dict.fromkeys(("fold_cloth", "drop_fold_cloth"), 350_000),
    **dict.fromkeys(("spread_cloth", "fold_crumpled_cloth"), 350_000),
    "drop_cloth": 200_000,
    **dict.fromkeys(("transport_water", "pour_water", "pour_water_amount"), 133_334),
}
NUMBER, PARTS = 4096, 10
EVALUATION = range(800, 832)


def decisions(task: str, number: int, device: str, budget: int) -> dict[str, Any]:
    """Seconds of the first decisions of an episode, and how it stands after these."""
    env = softgym_mj.load(task, split="all")
    plans: list[Plan] = []
    policy = ModelPredictivePolicy(
        env,
        make_planner("cem", task, budget=budget),
        DeviceRollouts(task, {}, device),
        on_decision=plans.append,
    )
    timestep, seconds = env.reset(VARIATION), []
    for _ in range(min(number, find(task).horizon)):
        start = time.perf_counter()
        action = policy(timestep)
        seconds.append(round(time.perf_counter() - start, 3))
        timestep = env.step(action)
    info = env.task.info()
    return {
        "env_steps": plans[0].env_steps,
        "seconds": seconds,
        "normalized_performance": float(info["normalized_performance"]),
    }


def steps(task: str, number: int, until: float) -> dict[str, Any]:
    """Random env steps: rate and memory by parts."""
    envs = softgym_mj.make_vec(task, NUMBER, device="cuda", split=EVALUATION)
    envs.reset(seed=0, options={"stagger": True})
    random = torch.Generator("cuda").manual_seed(0)
    each = max(number // NUMBER // PARTS, 1)
    rates, memory, flags = [], [], 0
    for _ in range(PARTS):
        torch.cuda.synchronize()
        start = time.perf_counter()
        for _ in range(each):
            numbers = torch.rand(envs.action_space.shape, generator=random, device="cuda")
            *_, infos = envs.step(2 * numbers - 1)
        torch.cuda.synchronize()
        rates.append(round(NUMBER * each / (time.perf_counter() - start), 1))
        memory.append(round(torch.cuda.memory_allocated() / 1e9, 3))
        flags = max(flags, int(infos["physics_warnings"].sum()))
        if time.monotonic() > until:
            break
    envs.close()
    return {
        "env_steps": NUMBER * each * len(rates),
        "env_steps_per_s": rates,
        "memory_gb": memory,
        "most_envs_with_warnings": flags,
        "finite": bool(np.isfinite(float(infos["normalized_performance"].mean()))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=("planner", "steps"))
    parser.add_argument("--tasks", nargs="+")
    parser.add_argument("--seconds", type=float, default=570.0, help="after which a part ends")
    parser.add_argument("--decisions", type=int, help="of the planner, of each task")
    parser.add_argument("--budget", type=int, default=BUDGET, help="env steps for a decision")
    parser.add_argument("--device", default="cuda", help="of the planner: cuda or host")
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    until, found = time.monotonic() + arguments.seconds, {}
    for task in arguments.tasks or (DECISIONS if arguments.part == "planner" else STEPS):
        if arguments.part == "planner":
            number = arguments.decisions or DECISIONS[task]
            found[task] = decisions(task, number, arguments.device, arguments.budget)
        else:
            found[task] = steps(task, STEPS[task], until)
        print(task, found[task], flush=True)
        if arguments.out:
            arguments.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
