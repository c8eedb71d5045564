"""Runs an evaluation; an interrupted one continues and returns the same result, byte for byte.

Every episode is a pure function of the configuration, its variation and its seed.
"""

import dataclasses
import functools
import json
import os
import pathlib
from collections.abc import Callable, Sequence

from softgym_mj import registry
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.load import load
from softgym_mj.evaluation.configuration import Configuration
from softgym_mj.evaluation.folder import open_folder
from softgym_mj.evaluation.rows import MOST, check_policy, play_rows
from softgym_mj.evaluation.statistics import methods, secondary_metrics, summary
from softgym_mj.exceptions import check_name
from softgym_mj.parallel.executors import BatchExecutor, Executor, SerialExecutor
from softgym_mj.policies.exported import has_images
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.model_predictive import ModelPredictivePolicy
from softgym_mj.policies.planners import PLANNERS, Plan
from softgym_mj.policies.rollouts import (
    Asking,
    ExecutorRollouts,
    Rollouts,
    answered,
    kept_environment,
    sent_to,
)
from softgym_mj.storage.files import write_json
from softgym_mj.storage.store import Store
from softgym_mj.vector.batch.rollouts import DeviceRollouts
from softgym_mj.vector.make import DEVICES

MOST_ENVS = 4096  # Samples that are simulated together; more need more memory.


@dataclasses.dataclass
class Progress:
    """Callbacks of an evaluation; each does nothing by default.

    Attributes:
        on_episode: Called with each episode's result, as `play_episode` returns it.
        on_decision: Called with each plan of a planner.
        on_step: Called with the number of env steps so far of episodes that are played together.
    """

    on_episode: Callable[[dict], None] = lambda episode: None
    on_decision: Callable[[Plan], None] = lambda plan: None
    on_step: Callable[[int], None] = lambda step: None


def evaluate(
    configuration: Configuration,
    folder: str | os.PathLike[str],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    trust: bool = False,
    device: str = "cpu",
) -> dict:
    """Plays all episodes that `folder` lacks, and writes `folder`/result.json.

    Workers share episodes, or a planner's samples. On a device, planners play many episodes
    together; the results do not depend on which, unless the policy observes images.

    Args:
        configuration: Configuration of the evaluation.
        folder: New folder, or that of an evaluation that differs only in variations and seeds (and
            in the device, unless the policy observes images). It identifies tasks by name: a
            custom task that has changed needs another folder. It identifies policies' files by
            content.
        executor: Executor of the simulations; None for this process.
        progress: Callbacks for episodes, decisions and env steps.
        trust: Whether the file of a policy may be loaded, as in `make_policy`.
        device: "cpu" simulates on the executor's workers, "cuda" and "host" in one batch (planners,
            and policies that read only observations).

    Returns:
        The content of result.json: configuration, `summary`, `secondary_metrics` and
        `methods` of `statistics`, and the episodes.

    Raises:
        StoreError: if the folder has another configuration, policy file or a damaged file.
        InvalidArgumentError: for an invalid policy, or a device that does not support the policy
            or the task.
    """
    check_name("device", device, DEVICES)
    if device != "cpu" and configuration.policy not in PLANNERS:
        check_policy(configuration.policy, device)
    executor, progress = executor or SerialExecutor(), progress or Progress()
    written = configuration.as_json()
    if has_images(configuration.settings.get("observation", "reduced")):
        # Two renderers draw images, which changes the scores of policies that see them.
        written["renderer"] = "OpenGL" if device == "cpu" else "batch"
    store = open_folder(pathlib.Path(folder), written)
    episodes: dict[tuple[int, int], dict] = {}

    def add(key: tuple[int, int], episode: dict) -> None:
        episodes[key] = episode
        progress.on_episode(episode)

    play: Callable
    if configuration.policy in PLANNERS:  # They use the executor for samples.
        play, executor = _planned(configuration, store, executor, progress, device)
    elif device != "cpu":
        task, settings = configuration.task, configuration.settings
        policy = configuration.policy
        play = functools.partial(
            play_rows, task, settings, policy, trust, device, on_step=progress.on_step
        )
        executor = BatchExecutor(MOST)
    else:
        sent = sent_to(executor, configuration.task)
        written_settings = json.dumps(dict(configuration.settings), sort_keys=True)
        play = functools.partial(play_episode, sent, written_settings, configuration.policy, trust)
    store.run(configuration.episodes, play, executor, add)
    ordered = [episodes[key] for key in configuration.episodes]
    result = {
        **written,
        "summary": summary(ordered),
        "secondary_metrics": secondary_metrics(ordered),
        "methods": methods(ordered),
        "episodes": ordered,
    }
    write_json(pathlib.Path(folder) / "result.json", result)
    return result


def _planned(
    configuration: Configuration, store: Store, executor: Executor, progress: Progress, device: str
) -> tuple[Callable[[Sequence[tuple[int, int]]], list[dict]], Executor]:
    """Returns a function that plays episodes of a planner, and an executor of its batch size."""
    planning = configuration.planning
    assert planning is not None
    planner = planning.planner(configuration.policy, configuration.task)
    rollouts: Rollouts
    if device == "cpu":
        rollouts = ExecutorRollouts(configuration.task, configuration.settings, executor)
        most = 1
    else:
        rollouts = DeviceRollouts(
            configuration.task, configuration.settings, device, configuration.variations
        )
        most = max(1, MOST_ENVS // planner.population)
    # Samples in this process use `kept_environment`, so episodes need environments of their own.
    settings = {"observation": "reduced", **configuration.settings}
    envs: list[Environment] = []

    def episode(env: Environment, variation: int, seed: int) -> Asking[dict]:
        policy = ModelPredictivePolicy(
            env,
            planner,
            rollouts,
            seed=seed,
            replan_every=planning.replan_every,
            journal=store.journal((variation, seed)),
            on_decision=progress.on_decision,
        )
        timestep, total = env.reset(variation), 0.0
        while not timestep.last():  # As `Environment.play`, but `act` yields to other episodes.
            timestep = env.step((yield from policy.act(timestep)))
            env.check_converged()
            total += timestep.reward
        return _scores(env, variation, seed, total)

    def play(calls: Sequence[tuple[int, int]]) -> list[dict]:
        while len(envs) < len(calls):
            envs.append(load(configuration.task, split="all", **settings))
        pairs = zip(envs, calls, strict=False)  # The last group may be smaller.
        return answered([episode(env, *call) for env, call in pairs], rollouts)

    return play, BatchExecutor(most)


def play_episode(
    task: registry.TaskRecord | bytes,
    settings: str,
    policy: str,
    trust: bool,
    variation: int,
    seed: int,
) -> dict:
    """Plays an episode of a policy without planning; returns its scores.

    Args:
        task: Value of `rollouts.sent_to`.
        settings: Keyword arguments of the task as JSON.
        policy, trust: Arguments of `make_policy`.
        variation, seed: Variation of the episode and seed of the policy.

    Raises:
        SimulationError: if the episode diverges.
    """
    env, total = kept_environment(task, settings), 0.0
    for timestep in env.play(make_policy(policy, env, seed, trust=trust), variation):
        total += timestep.reward or 0.0  # A reset has the reward None.
    return _scores(env, variation, seed, total)


def _scores(env: Environment, variation: int, seed: int, total: float) -> dict:
    """Returns the scores of a finished episode."""
    info = env.info()
    return {
        "variation": variation,
        "seed": seed,
        "normalized_performance": float(info["normalized_performance"]),
        "performance": float(info["performance"]),
        "success": bool(info["success"]),
        "return": total,
        "secondary_metrics": env.task.last_secondary_metrics,
    }
