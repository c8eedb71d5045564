"""Env steps a second of vector environments in one, two and more processes.

The same environments with the same random actions, however many processes they are spread over.

Rounds take turns, so that a busy machine slows all alike, and each starts from other variations,
as how even the shares are depends on them. Rates and gains are medians over the rounds.

    OMP_NUM_THREADS=1 python benchmarks/vector.py --envs 16 --workers 1 2 --out vector.json
"""

import argparse
import json
import os
import pathlib
import statistics
import time

# One core a worker: software OpenGL would have one worker render on several.
os.environ.setdefault("LP_NUM_THREADS", "0")

import gymnasium
import numpy as np

import softgym_mj
from benchmarks.machine import machine, yardstick

TASKS = ("straighten_rope", "spread_cloth", "transport_water")
OBSERVATIONS = ("reduced", "rgb")
WARM_UP = 3  # Steps before the clock runs: the first renders compile shaders.


class Crowd:
    """A vector environment with random actions."""

    def __init__(self, task: str, observation: str, num_envs: int, num_workers: int):
        record = softgym_mj.TASKS[task]
        self.envs = gymnasium.make_vec(
            record.gymnasium_id, num_envs=num_envs, num_workers=num_workers, observation=observation
        )
        size = (record.horizon + 1, *self.envs.action_space.shape)
        self.actions = np.random.default_rng(0).uniform(-1, 1, size).astype(np.float32)

    def rate(self, seed: int, steps: int) -> float:
        """Env steps a second, of all together, from the variations that `seed` draws."""
        self.envs.reset(seed=seed * self.envs.num_envs)
        for actions in self.actions[:WARM_UP]:
            self.envs.step(actions)
        start = time.perf_counter()
        for i in range(steps):
            self.envs.step(self.actions[(WARM_UP + i) % len(self.actions)])
        return steps * self.envs.num_envs / (time.perf_counter() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=TASKS, choices=softgym_mj.TASKS)
    parser.add_argument("--observations", nargs="+", default=OBSERVATIONS)
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--workers", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=3.0, help="of a turn, about")
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    rows = []
    for task in arguments.tasks:
        for observation in arguments.observations:
            crowds = {
                n: Crowd(task, observation, arguments.envs, n) for n in sorted(arguments.workers)
            }
            rates: dict[int, list[float]] = {n: [] for n in crowds}
            # As many steps for all: they see the same states.
            slowest = min(crowd.rate(0, WARM_UP) for crowd in crowds.values())
            steps = max(1, round(slowest * arguments.seconds / arguments.envs))
            for seed in range(arguments.rounds):
                for number, crowd in crowds.items():
                    rates[number].append(crowd.rate(seed, steps))
            least = min(rates)
            for number, crowd in crowds.items():
                gains = [a / b for a, b in zip(rates[number], rates[least], strict=True)]
                row = {"task": task, "observation": observation,
                       "environments": arguments.envs, "workers": number,
                       "env_steps_per_second": round(statistics.median(rates[number]), 1),
                       "gain": round(statistics.median(gains), 2)}  # fmt: skip
                rows.append(row)
                print(json.dumps(row), flush=True)
                crowd.envs.close()
    if arguments.out:
        where = {**machine(), "humanoid_mj_steps_per_second": yardstick()}
        arguments.out.write_text(json.dumps({"machine": where, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
