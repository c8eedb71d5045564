"""Env steps per second of planning: what rollouts add to stepping, and how they scale.

Every turn plays the same sequences from the same state, in this order: plain `env.step` in a loop,
`ExecutorRollouts` in this process, in one and two processes, in one and two threads. Medians over
turns; ratios are medians of the turns' ratios, as machines are noisy.

    OMP_NUM_THREADS=1 python benchmarks/planning.py --tasks straighten_rope fold_cloth
"""

import argparse
import concurrent.futures
import functools
import json
import pathlib
import threading
import time

import numpy as np

import softgym_mj
from softgym_mj.parallel.executors import Executor, ProcessExecutor, SerialExecutor
from softgym_mj.policies.rollouts import ExecutorRollouts

SETTINGS = {"rope": {}, "cloth": {}, "water": {}}
SEQUENCES, HORIZON = {"rope": 60, "cloth": 12, "water": 24}, 15
VARIATION = 803


class Threads(Executor):
    """Threads with an environment each: MuJoCo releases the interpreter's lock in a step."""

    def __init__(self, number: int):
        self._pool = concurrent.futures.ThreadPoolExecutor(number)
        self._number, self._own = number, threading.local()

    @property
    def number(self) -> int:
        return self._number

    def _play(self, task, settings, snapshot, sequences):
        if not hasattr(self._own, "env"):
            kwargs = json.loads(settings)
            self._own.env = softgym_mj.load(task, split="all", observation="reduced", **kwargs)
        return step_through(self._own.env, snapshot, sequences)

    def results(self, function, calls):
        yield from enumerate(self._pool.map(lambda call: self._play(*call), calls))

    def close(self):
        self._pool.shutdown()


def step_through(env, snapshot, sequences) -> np.ndarray:
    """Returns (n,) by the plainest loop."""
    returns = np.zeros(len(sequences))
    for i, actions in enumerate(sequences):
        env.set_state(snapshot)
        for action in actions:
            returns[i] += env.step(action).reward
    return returns


def measure(task: str, turns: int) -> dict[str, float]:
    """Env steps/s by way of computing, and ratios."""
    kind = softgym_mj.TASKS[task].tags[-1]
    settings = SETTINGS[kind]
    env = softgym_mj.load(task, split="all", observation="reduced", **settings)
    env.reset(VARIATION)
    snapshot = env.get_state()
    size = env.task.actor.action_size
    sequences = np.random.default_rng(0).uniform(-1, 1, (SEQUENCES[kind], HORIZON, size))
    executors = {
        "here": SerialExecutor(),
        **{f"processes_{number}": ProcessExecutor(number) for number in (1, 2)},
        **{f"threads_{number}": Threads(number) for number in (1, 2)},
    }
    ways = {"plain": functools.partial(step_through, env)}
    for name, own in executors.items():
        ways[name] = ExecutorRollouts(task, settings, own).returns
    expected = {name: way(snapshot, sequences) for name, way in ways.items()}  # Warms up, too.
    for name, returns in expected.items():
        np.testing.assert_array_equal(returns, expected["plain"], err_msg=name)
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(turns):
        for name, way in ways.items():
            start = time.perf_counter()
            way(snapshot, sequences)
            seconds[name].append(time.perf_counter() - start)
    for own in executors.values():
        own.close()
    steps = sequences.shape[0] * HORIZON
    rates = {f"{name}_per_second": steps / float(np.median(s)) for name, s in seconds.items()}

    def ratio(first: str, second: str) -> float:
        return float(np.median(np.divide(seconds[first], seconds[second])))

    return {
        **rates,
        "overhead": ratio("here", "plain") - 1.0,
        "processes_2_over_1": ratio("processes_1", "processes_2"),
        "threads_2_over_1": ratio("threads_1", "threads_2"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    tasks = ["straighten_rope", "fold_cloth", "transport_water"]
    parser.add_argument("--tasks", nargs="+", choices=softgym_mj.TASKS, default=tasks)
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    results = {}
    for task in arguments.tasks:
        results[task] = measure(task, arguments.turns)
        print(task, {name: round(value, 3) for name, value in results[task].items()}, flush=True)
    if arguments.out:
        arguments.out.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
