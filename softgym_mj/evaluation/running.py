"""Runs an evaluation, which can be killed and run again: its result is the same, byte for byte.

Every episode is a pure function of the configuration, its variation and its seed.
"""

import dataclasses
import json
import os
import pathlib
from collections.abc import Callable, Iterable, Sequence

from softgym_mj import registry
from softgym_mj.envs.load import load
from softgym_mj.evaluation.configuration import Configuration
from softgym_mj.evaluation.folder import Folder
from softgym_mj.evaluation.statistics import methods, summary
from softgym_mj.jobs.executors import Executor, SerialExecutor
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.model_predictive import ModelPredictivePolicy
from softgym_mj.policies.planners import PLANNERS, Plan
from softgym_mj.policies.rollouts import Rollouts, kept_environment, sent_to


@dataclasses.dataclass
class Progress:
    """What the listener of an evaluation may want to show; nothing is called by default.

    Attributes:
        on_episode: called with each episode's result, as `play_episode` returns it.
        on_decision: called with each plan of a planner.
    """

    on_episode: Callable[[dict], None] = lambda episode: None
    on_decision: Callable[[Plan], None] = lambda plan: None


def evaluate(
    configuration: Configuration,
    folder: str | os.PathLike[str],
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> dict:
    """Plays all episodes that `folder` does not hold yet, and writes `folder`/result.json.

    Planners share out their samples to the workers, other policies their episodes.

    Args:
        configuration: what is evaluated.
        folder: of this evaluation alone, or of one with other variations and seeds. It knows tasks
            by name: a task of your own that has changed since needs another folder. A policy whose
            file has changed is refused.
        executor: where it is simulated; None for this process.
        progress: told of episodes and decisions.

    Returns:
        The content of the result: configuration, machines on which it was evaluated, `summary` and
        `methods` of its `statistics`, episodes.

    Raises:
        ResultError: if the folder belongs to another configuration or holds a damaged file.
        PolicyFileError: for a saved policy that is none.
    """
    executor, progress = executor or SerialExecutor(), progress or Progress()
    written = configuration.as_json()
    kept = Folder(pathlib.Path(folder), written)
    found = {key: kept.episode(*key) for key in configuration.episodes}
    episodes = {key: episode for key, episode in found.items() if episode is not None}
    for episode in episodes.values():
        progress.on_episode(episode)
    missing = [key for key in configuration.episodes if key not in episodes]
    for key, episode in _played(configuration, missing, kept, executor, progress):
        kept.add(episode)
        episodes[key] = episode
        progress.on_episode(episode)
    ordered = [episodes[key] for key in configuration.episodes]
    result = {
        **written,
        "machines": kept.machines,
        "summary": summary(ordered),
        "methods": methods(ordered),
        "episodes": ordered,
    }
    kept.finish(result)
    return result


def _played(
    configuration: Configuration,
    missing: Sequence[tuple[int, int]],
    folder: Folder,
    executor: Executor,
    progress: Progress,
) -> Iterable[tuple[tuple[int, int], dict]]:
    settings = json.dumps(dict(configuration.settings), sort_keys=True)
    if configuration.policy not in PLANNERS:
        task = sent_to(executor, configuration.task)
        calls = [(task, settings, configuration.policy, *key) for key in missing]
        for index, episode in executor.results(play_episode, calls):
            yield missing[index], episode
        return
    planning = configuration.planning
    assert planning is not None
    # Not `kept_environment`: in this process the samples are played in that one.
    env = load(
        configuration.task, split="all", **{"observation": "reduced", **configuration.settings}
    )
    rollouts = Rollouts(configuration.task, configuration.settings, executor)
    for variation, seed in missing:
        policy = ModelPredictivePolicy(
            env,
            configuration.planner(),
            rollouts,
            seed=seed,
            replan_every=planning.replan_every,
            journal=folder.journal(variation, seed),
            on_decision=progress.on_decision,
        )
        yield (variation, seed), _play(env, policy, variation, seed)


def play_episode(
    task: registry.TaskRecord | bytes, settings: str, policy: str, variation: int, seed: int
) -> dict:
    """Plays an episode of a policy that does not plan; returns its scores.

    Args:
        task: as `rollouts.sent_to` returns it.
        settings: keyword arguments of the task as JSON.
        policy, variation, seed: of the episode.
    """
    env = kept_environment(task, settings)
    return _play(env, make_policy(policy, env, seed), variation, seed)


def _play(env, policy, variation: int, seed: int) -> dict:
    timestep, total = env.reset(variation), 0.0
    while not timestep.last():
        timestep = env.step(policy(timestep))
        total += timestep.reward
    info = env.info()
    return {
        "variation": variation,
        "seed": seed,
        "normalized_performance": info["normalized_performance"],
        "performance": info["performance"],
        "success": info["success"],
        "return": total,
    }
