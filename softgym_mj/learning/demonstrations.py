"""Demonstrations: episodes of a task's scripted expert for learners.

The Gymnasium environment plays them with MuJoCo on the CPU. They are stored in the package's cache,
one file each, for interrupted and later trainings, until the expert's code changes.
"""

import functools
import json
import logging
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import torch
from torch import Tensor

import softgym_mj
from softgym_mj import registry
from softgym_mj.exceptions import InvalidArgumentError, check_count, check_name
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.replay import Replay
from softgym_mj.learning.symmetries import Symmetry
from softgym_mj.native.caches import cache_folder
from softgym_mj.parallel.executors import make_executor
from softgym_mj.policies.experts import sources_sha256
from softgym_mj.policies.rollouts import sent_to
from softgym_mj.recording.episodes import LABELS, played
from softgym_mj.recording.noise import check_noise
from softgym_mj.registry import TaskRecord
from softgym_mj.storage.store import ARRAYS, Store
from softgym_mj.variations.indices import SPLITS
from softgym_mj.vector.processes import num_cores

POLICY = "scripted"
OBSERVATIONS = ("reduced", "markov", "full")
_KEPT = ("rewards", "terminations")  # Arrays that are stored besides observations.
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


def collect(
    problem: Problem,
    episodes: int,
    jobs: int | None = None,
    noise: float = 0.0,
) -> Step:
    """Collects the expert's steps (episodes, steps, ...) in training variations 0..episodes - 1.

    With noise, actions are the expert's own, not the applied ones.

    Args:
        problem: Learning problem: task, observations, reward scale and device.
        episodes: Number of episodes.
        jobs: Number of processes; None for the number of cores.
        noise: Standard deviation of the noise on applied actions, as in `recording.record`.

    Raises:
        InvalidArgumentError: for too many episodes, for images, for invalid noise, or if the task
            has no expert.
        StoreError: if the cache cannot be written.
    """
    check_name("observation", problem.observed, OBSERVATIONS)
    result = _collected(problem, {"observation": problem.observed}, episodes, jobs, noise)
    seen, terminated = result["observations"], result["terminations"]
    ended = terminated.clone()
    ended[:, -1] = True
    rewards = problem.reward_scale * result["rewards"].float()
    return Step(seen[:, :-1], result[_shown(noise)], rewards, seen[:, 1:], terminated, ended)


def collect_images(
    problem: Problem, episodes: int, jobs: int | None = None, noise: float = 0.0
) -> tuple[dict[str, Tensor], Tensor]:
    """Collects demonstrations of several observations, of which MuJoCo renders the images.

    Args:
        problem: Learning problem with several observations.
        episodes, jobs, noise: Arguments of `collect`.

    Returns:
        Observations by name before each env step, and actions of the expert (episodes, steps, ...).

    Raises:
        InvalidArgumentError, StoreError: as in `collect`.
    """
    seen: dict[str, Any] = {"observation": [*problem.shapes]}
    if sizes := [shape for shape in problem.shapes.values() if len(shape) > 1]:
        seen["image_size"] = sizes[0][-3:-1] if len(sizes[0]) > 2 else sizes[0]
    result = _collected(problem, seen, episodes, jobs, noise)
    names = seen["observation"]
    keys = [f"observations/{name}" for name in names] if len(names) > 1 else ["observations"]
    observations = {name: result[key][:, :-1] for name, key in zip(names, keys, strict=True)}
    return observations, result[_shown(noise)]


def _collected(
    problem: Problem,
    seen: Mapping[str, Any],
    episodes: int,
    jobs: int | None,
    noise: float,
) -> dict[str, Tensor]:
    """Returns the arrays of episodes (episodes, ...) by name.

    Args:
        seen: Arguments of the task that set its observation.
        problem, episodes, jobs, noise: Arguments of `collect`.
    """
    check_demonstrations(episodes, jobs)
    check_noise(noise)
    settings = {**seen, **problem.task_settings}
    specification = {
        "task": problem.task,
        "policy": POLICY,
        "policy_sha256": sources_sha256(registry.find(problem.task)),
        "settings": settings,
        "noise": noise,
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
        play_one = functools.partial(_played, sent_to(executor, problem.task), written, noise)
        store.run(range(episodes), play_one, executor, add, replace=True)
    return {
        name: torch.as_tensor(
            np.stack([result[variation][name] for variation in range(episodes)]),
            device=problem.device,
        )
        for name in result[0]
    }


def _played(
    task: TaskRecord | bytes, settings: str, noise: float, variation: int
) -> dict[str, np.ndarray]:
    """Returns the observations, `_KEPT` arrays and demonstrated actions of an episode."""
    arrays = played(task, settings, POLICY, 0, False, "keep", noise, variation)
    kept = *_KEPT, _shown(noise)
    return {
        name: array
        for name, array in arrays.items()
        if name.startswith("observations") or name in kept
    }


def _shown(noise: float) -> str:
    """Returns the name of the array of the expert's own actions."""
    return LABELS if noise else "actions"


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
