"""Env steps per second of every task on one core, with arms too, what Python adds, image rate.

A stored state in the middle of a random episode is replayed, so that runs time the same physics.
Rates are all steps over all seconds; the mean of the variations' own rates is given beside.
SoftGym's own figure, for comparison: 46 env steps/s with rendering on a 2080Ti.

    python benchmarks/throughput.py --out new.json

The yardstick is the speed of dm_control's humanoid on the same core, between the tasks.
"""

import argparse
import json
import pathlib
import statistics
import time
from collections.abc import Iterator
from typing import Any
from unittest import mock

import mujoco
import numpy as np

import softgym_mj
from benchmarks.machine import machine, yardstick
from softgym_mj.envs.environment import Environment
from softgym_mj.rendering import framebuffer
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.robots.arm.models import ARMS

SOFTGYM = 46.0  # Env steps/s, docs/softgym.md 6.
# Env steps timed per variation, and evaluation variations.
STEPS = {"rope": 75, "cloth": 50, "water": 25}
FEW = range(800, 805)
MANY = range(800, 820)  # Few steps each of many: they have 224 to 8788 particles.
VARIATIONS = {"rope": FEW, "cloth": FEW, "water": MANY}
IMAGES = 60


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


def _stopwatch_seconds() -> float:
    """What a call through `_TimedMujoco` costs outside of what it measures [s]."""
    clock, calls = _TimedMujoco(lambda *arguments: None), 100_000
    start = time.perf_counter()
    for _ in range(calls):
        clock.mj_step(None, None)
    return (time.perf_counter() - start - clock.seconds) / calls


def _random_actions(task: str, actor: str | None) -> Iterator[tuple[Environment, np.ndarray]]:
    """(environment, actions (steps, n)) at the start of an episode, for each variation."""
    settings = {} if actor is None else {"actor": actor}
    env = softgym_mj.load(task, split="evaluate", observation="reduced", **settings)
    random = np.random.default_rng(0)
    kind = softgym_mj.TASKS[task].tags[-1]
    steps = min(STEPS[kind], env.horizon - 1)
    for variation in VARIATIONS[kind]:
        env.reset(variation)
        yield env, random.uniform(-1, 1, (steps, *env.action_spec().shape))


def shares(task: str) -> dict[str, float]:
    """Env steps/s of every arm as a share of the usual actor's, turn by turn.

    Every actor plays a variation before the next one comes, so that all find the machine alike.
    """
    seconds: dict[str | None, float] = {}
    for turns in zip(*(_random_actions(task, actor) for actor in (None, *ARMS)), strict=True):
        for actor, (env, actions) in zip((None, *ARMS), turns, strict=True):
            start = time.thread_time()
            for action in actions:
                env.step(action)
            seconds[actor] = seconds.get(actor, 0.0) + time.thread_time() - start
    return {actor: seconds[None] / seconds[actor] for actor in ARMS}


def measure(task: str) -> dict[str, Any]:
    """Rates of one task with random actions."""
    stopwatch = _stopwatch_seconds()
    plain, timed, inside = [], 0.0, 0.0
    for env, actions in _random_actions(task, None):
        snapshot = env.get_state()
        start = time.thread_time()
        for action in actions:
            env.step(action)
        plain.append(time.thread_time() - start)
        env.set_state(snapshot)
        clock = _TimedMujoco()
        with mock.patch.object(framebuffer, "mujoco", clock):
            start = time.perf_counter()
            for action in actions:
                env.step(action)
            timed += time.perf_counter() - start - clock.calls * stopwatch
        inside += clock.seconds
    rate = len(actions) * len(plain) / sum(plain)
    view = CameraView("task", 128, 128)
    view.rgb(env.physics)
    start = time.perf_counter()
    for _ in range(IMAGES):
        view.rgb(env.physics)
    images = IMAGES / (time.perf_counter() - start)
    return {
        "env_steps_per_second": rate,
        "mean_of_variations_rates": float(np.mean([len(actions) / seconds for seconds in plain])),
        "times_softgym": rate / SOFTGYM,
        "share_outside_mj_step": 1.0 - inside / timed,
        "images_128_per_second": images,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", choices=softgym_mj.TASKS, default=softgym_mj.TASKS)
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    results, yardsticks = {}, []
    for task in arguments.tasks:
        yardsticks.append(yardstick())
        results[task] = {**measure(task), "arms": shares(task)}
        print(task, results[task], flush=True)
    where = {**machine(), "mujoco": mujoco.__version__,
             "humanoid_mj_steps_per_second": statistics.median(yardsticks)}  # fmt: skip
    print(where)
    if arguments.out:
        content = {"machine": where, "tasks": results}
        arguments.out.write_text(json.dumps(content, indent=2) + "\n")


if __name__ == "__main__":
    main()
