"""Env steps per second of every task on one core, what `env.step` adds to MuJoCo, image rate.

A stored state in the middle of a random episode is replayed, so that runs time the same physics.
Rates are all steps over all seconds; the mean of the variations' own rates is given beside.
SoftGym's own figure, for comparison: 46 env steps/s with rendering on a 2080Ti.

    python benchmarks/throughput.py --out new.json
    python benchmarks/throughput.py --compare old.json new.json
    python benchmarks/throughput.py --actors franka sawyer
"""

import argparse
import json
import pathlib
import platform
import time
from collections.abc import Iterator, Sequence
from unittest import mock

import mujoco
import numpy as np

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.rendering import framebuffer
from softgym_mj.rendering.offscreen import CameraView

SOFTGYM = 46.0  # Env steps/s, facts 6.
# Env steps timed per variation, and evaluation variations.
STEPS = {"rope": 75, "cloth": 50, "water": 25}
FEW = range(800, 805)
MANY = range(800, 820)  # Few steps each of many: they have 224 to 8788 particles.
VARIATIONS = {"rope": FEW, "cloth": FEW, "water": MANY}
IMAGES = 60
USUAL = "usual actor"


class _TimedMujoco:
    """Stands in for the mujoco module and adds up the time spent in mj_step."""

    def __init__(self, step=mujoco.mj_step):
        self.seconds, self.calls, self._step = 0.0, 0, step

    def __getattr__(self, name):
        return getattr(mujoco, name)

    def mj_step(self, *arguments):
        start = time.perf_counter()
        self._step(*arguments)
        self.seconds += time.perf_counter() - start
        self.calls += 1


def _stopwatch_seconds(calls: int = 100_000) -> float:
    """What a call through `_TimedMujoco` costs outside of what it measures [s]."""
    clock = _TimedMujoco(lambda *arguments: None)
    start = time.perf_counter()
    for _ in range(calls):
        clock.mj_step(None, None)
    return (time.perf_counter() - start - clock.seconds) / calls


def _env(task: str, actor: str | None) -> Environment:
    settings = {} if actor is None else {"actor": actor}
    return softgym_mj.load(task, split="evaluate", observation="reduced", **settings)


def _random_actions(task: str, actor: str | None) -> Iterator[tuple]:
    """(environment, actions (steps, n)) at the start of an episode, for each variation."""
    env, random = _env(task, actor), np.random.default_rng(0)
    kind = softgym_mj.TASKS[task].tags[-1]
    steps = min(STEPS[kind], env.horizon - 1)
    for variation in VARIATIONS[kind]:
        env.reset(variation)
        yield env, random.uniform(-1, 1, (steps, *env.action_spec().shape))


def compare(task: str, actors: Sequence[str]) -> dict[str, float]:
    """Rates [1/s] with random actions of the usual actor and of others, turn by turn.

    Every actor plays a variation before the next one comes, so that all find the machine alike.
    """
    rates: dict[str, list[float]] = {}
    for turns in zip(*(_random_actions(task, actor) for actor in (None, *actors)), strict=True):
        for actor, (env, actions) in zip((USUAL, *actors), turns, strict=True):
            start = time.perf_counter()
            for action in actions:
                env.step(action)
            rates.setdefault(actor, []).append((time.perf_counter() - start) / len(actions))
    return {actor: 1.0 / float(np.mean(seconds)) for actor, seconds in rates.items()}


def measure(task: str) -> dict[str, float]:
    """Rates of one task with random actions."""
    env = _env(task, None)
    random = np.random.default_rng(0)
    stopwatch = _stopwatch_seconds()
    plain, timed, inside = [], 0.0, 0.0
    kind = softgym_mj.TASKS[task].tags[-1]
    steps = min(STEPS[kind], env.horizon - 1)
    for variation in VARIATIONS[kind]:
        env.reset(variation)
        actions = random.uniform(-1, 1, (steps, *env.action_spec().shape))
        snapshot = env.get_state()
        start = time.perf_counter()
        for action in actions:
            env.step(action)
        plain.append(time.perf_counter() - start)
        env.set_state(snapshot)
        clock = _TimedMujoco()
        with mock.patch.object(framebuffer, "mujoco", clock):
            start = time.perf_counter()
            for action in actions:
                env.step(action)
            timed += time.perf_counter() - start - clock.calls * stopwatch
        inside += clock.seconds
    rate = steps * len(plain) / sum(plain)
    view = CameraView("task", 128, 128)
    view.rgb(env.physics)
    start = time.perf_counter()
    for _ in range(IMAGES):
        view.rgb(env.physics)
    images = IMAGES / (time.perf_counter() - start)
    return {
        "env_steps_per_second": rate,
        "mean_of_variations_rates": float(np.mean([steps / seconds for seconds in plain])),
        "times_softgym": rate / SOFTGYM,
        "share_outside_mj_step": 1.0 - inside / timed,
        "images_128_per_second": images,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", choices=softgym_mj.TASKS, default=softgym_mj.TASKS)
    parser.add_argument("--actors", nargs="+", default=[], help="compared with the usual one")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--compare", type=pathlib.Path, nargs=2, metavar=("OLD", "NEW"))
    arguments = parser.parse_args()
    if arguments.compare:
        old, new = (json.loads(file.read_text())["tasks"] for file in arguments.compare)
        for task in old.keys() & new.keys():
            for name, value in old[task].items():
                print(f"{task:18} {name:24} {value:9.3f} -> {new[task][name]:9.3f} "
                      f"({new[task][name] / value:.2f} x)")  # fmt: skip
        return
    results = {}
    if arguments.actors:
        for task in arguments.tasks:
            rates = compare(task, arguments.actors)
            usual = rates.pop(USUAL)
            shares = {actor: f"{rate:.1f}/s, {rate / usual:.2f}" for actor, rate in rates.items()}
            print(f"{task:20} {USUAL} {usual:.1f}/s", shares, flush=True)
        return
    for task in arguments.tasks:
        results[task] = measure(task)
        print(task, {name: round(value, 3) for name, value in results[task].items()}, flush=True)
    if arguments.out:
        machine = {"processor": platform.processor(), "mujoco": mujoco.__version__}
        arguments.out.write_text(json.dumps({"machine": machine, "tasks": results}, indent=2))


if __name__ == "__main__":
    main()
