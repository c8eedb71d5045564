"""Demonstrations: episodes of a task's scripted expert for learners.

The Gymnasium environment plays them with MuJoCo on the CPU. They are stored in the package's cache,
one file each, for interrupted and later trainings, until the expert's code changes.
"""

import functools
import json
import logging
from collections.abc import Sequence

import mujoco
import numpy as np
import torch

import softgym_mj
from softgym_mj import registry
from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.replay import Replay
from softgym_mj.learning.symmetries import Symmetry
from softgym_mj.native.caches import cache_folder
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.experts import sources_sha256
from softgym_mj.policies.rollouts import sent_to
from softgym_mj.recording.episodes import played
from softgym_mj.registry import TaskRecord
from softgym_mj.storage.store import ARRAYS, Store
from softgym_mj.variations.indices import SPLITS
from softgym_mj.vector.processes import num_cores

POLICY = "scripted"
_STORED = ("observations", "actions", "rewards", "terminations")  # Arrays of an episode.
_APART = 0x44454D4F  # Separates the random numbers of batches from those of other replays.

_log = logging.getLogger(__name__)
_NOTICE = (
    "Collecting %d demonstrations of %s in %d processes (seconds to minutes); they are stored in %s"
)


def check_demonstrations(episodes: int, jobs: int | None) -> None:
    """Raises `InvalidArgumentError` for an invalid number of demonstrations or processes."""
    check_count("demonstrations", episodes, 1, len(SPLITS["train"]))
    if jobs is not None:
        check_count("jobs", jobs, 1)


def collect(problem: Problem, episodes: int, jobs: int | None = None) -> Step:
    """Collects the expert's steps (episodes, steps, ...) in training variations 0..episodes - 1.

    Args:
        problem: Learning problem: task, observation, reward scale and device.
        episodes: Number of episodes.
        jobs: Number of processes; None for the number of cores.

    Raises:
        InvalidArgumentError: if the task has no expert.
        StoreError: if the cache cannot be written.
    """
    settings = {"observation": problem.observed, **problem.task_settings}
    specification = {
        "task": problem.task,
        "policy": POLICY,
        "policy_sha256": sources_sha256(registry.find(problem.task)),
        "settings": settings,
        "versions": {"softgym_mj": softgym_mj.__version__, "mujoco": mujoco.__version__},
    }
    store = Store(cache_folder() / "demonstrations", specification, ARRAYS)
    store.folder /= f"{problem.task}-{store.digest[:12]}"
    result: dict[int, dict[str, np.ndarray]] = {}

    def add(variation: int, arrays: dict[str, np.ndarray]) -> None:
        result[variation] = arrays
        _log.info("%d of %d demonstrations", len(result), episodes)

    with make_executor(jobs or num_cores()) as executor:
        if missing := sum(not store.has(variation) for variation in range(episodes)):
            _log.info(_NOTICE, missing, problem.task, executor.number, store.folder)
        written = json.dumps(settings, sort_keys=True)
        play_one = functools.partial(_played, sent_to(executor, problem.task), written)
        store.run(range(episodes), play_one, executor, add, replace=True)
    seen, action, reward, terminated = (
        torch.as_tensor(np.stack([result[k][name] for k in range(episodes)]), device=problem.device)
        for name in _STORED
    )
    ended = terminated.clone()
    ended[:, -1] = True
    rewards = problem.reward_scale * reward.float()
    return Step(seen[:, :-1], action, rewards, seen[:, 1:], terminated, ended)


def _played(task: TaskRecord | bytes, settings: str, variation: int) -> dict[str, np.ndarray]:
    """Returns the arrays of an episode that are stored."""
    arrays = played(task, settings, POLICY, 0, False, "keep", 0.0, variation)
    return {name: arrays[name] for name in _STORED}


def replay_of(
    shown: Step,
    seeds: Sequence[int],
    *,
    discount: float = 1.0,
    steps: int = 1,
    symmetries: Sequence[Symmetry] = (),
) -> Replay:
    """Returns a replay with the same demonstrations for each seed; batches differ by seed.

    Args:
        shown: Value of `collect`.
        seeds: Seeds of the trainings.
        discount, steps, symmetries: Arguments of `Replay`.

    Raises:
        InvalidArgumentError: for symmetries of other observations.
    """
    (episodes, length), size = shown.reward.shape, shown.observation.shape[-1]
    if symmetries and len(symmetries[0].observation) != size:
        raise InvalidArgumentError("symmetric", True, "False, unless observations are reduced")
    replay = Replay(
        length, [seed + _APART for seed in seeds], episodes, (size,), shown.action.shape[-1],
        discount=discount, steps=steps, symmetries=symmetries, device=shown.reward.device,
    )  # fmt: skip
    for k in range(length):
        now = (value[:, k] for value in shown)
        replay.add(Step(*(value.expand(len(seeds), *value.shape) for value in now)))
    return replay
