"""Updates a second of methods on this machine, by preset and number of seeds side by side.

    python -m benchmarks.learning --device cuda --out docs/learning_rates.json

Replays are filled with random numbers: no environment is stepped. On a GPU updates are CUDA graphs.
"""

import argparse
import dataclasses
import json
import pathlib
import time
from typing import Any

import torch

import softgym_mj
from benchmarks.gpu import machine
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.registry import METHODS, find_preset

SECONDS = 4.0  # For which the clock runs, about.
WARM_UP = 12  # Updates before that: CUDA's graphs are made.


def updates_per_second(name: str, preset: str, task: str, seeds: int, device: str) -> float:
    """Of all seeds together: an update of each counts as one."""
    training, method = find_preset(name, preset, task)
    if hasattr(method.settings, "random_steps"):
        settings = dataclasses.replace(method.settings, random_steps=0)
        method = dataclasses.replace(method, settings=settings)
    sized: dict[str, Any] = (
        {"image_size": training.image_size} if training.observation == "rgb" else {}
    )
    env = softgym_mj.make_vec(
        task, 1, device="host", observation=training.observation, **sized, **training.task_settings,
    )  # fmt: skip
    observation, action = env.single_observation_space.shape, env.single_action_space.shape
    env.close()
    assert observation is not None and action is not None
    problem = Problem(
        task, training.task_settings, range(seeds), training.num_envs, observation, action[-1],
        training.reward_scale, device, training.observation,
    )  # fmt: skip
    learner = method.make(method.settings, problem)
    lead = seeds, training.num_envs
    no = torch.zeros(lead, dtype=torch.bool, device=device)

    def step() -> None:
        seen, following = (torch.randn(*lead, *observation, device=device) for _ in range(2))
        acted, _ = learner.act(seen, no, None, explore=True)
        learner.learn(Step(seen, acted, torch.rand(lead, device=device), following, no, no))

    while learner.updates < WARM_UP:
        step()
    _wait(device)
    before, start = learner.updates, time.perf_counter()
    while time.perf_counter() - start < SECONDS:
        step()
        _wait(device)
    return round((learner.updates - before) / (time.perf_counter() - start), 1)


def _wait(device: str) -> None:
    if device == "cuda":
        torch.cuda.synchronize()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=["sac"])
    parser.add_argument("--presets", nargs="+", default=["paper", "fast"])
    parser.add_argument("--tasks", nargs="+", default=["straighten_rope"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 5], help="side by side")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    torch.set_float32_matmul_precision("high")
    rates: dict[str, Any] = {}
    for name in arguments.methods:
        for preset in arguments.presets:
            for task in arguments.tasks:
                for seeds in arguments.seeds:
                    rate = updates_per_second(name, preset, task, seeds, arguments.device)
                    print(name, preset, task, seeds, rate, flush=True)
                    rates[f"{name} {preset} {task} {seeds}"] = rate
    if arguments.out:
        found = {"machine": machine(), "updates_per_second": rates}
        arguments.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
