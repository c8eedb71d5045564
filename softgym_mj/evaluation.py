"""The paper's evaluation: normalised performance at the last step of evaluation variations.

Every episode is a pure function of the configuration, its variation and its seed. An evaluation
keeps one file for each finished episode, and a journal of a planned one, so that it can be killed
and run again; its result is the same file, byte for byte.
"""

import dataclasses
import json
import os
import pathlib
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

import softgym_mj
from softgym_mj import registry
from softgym_mj.baselines.cem import (
    BUDGET,
    ITERATIONS,
    PLANNERS,
    Plan,
    make_planner,
    usual_horizon,
)
from softgym_mj.baselines.model_predictive import ModelPredictivePolicy
from softgym_mj.baselines.policies import SIMPLE, is_saved, make_policy
from softgym_mj.baselines.rollouts import Rollouts, kept_environment, sent_to
from softgym_mj.exceptions import ResultError, UnknownNameError, check_count
from softgym_mj.files import write_whole
from softgym_mj.variations import check_variation, split_indices
from softgym_mj.workers import Here, Workers

# Counts up when scores of the same episode would differ: results of two versions are not mixed.
PROTOCOL = 1
POLICIES = (*SIMPLE, *PLANNERS)


@dataclasses.dataclass(frozen=True)
class Planning:
    """How a planner looks for actions: see `baselines.cem`.

    Attributes:
        horizon: env steps that a plan looks ahead; None for the task's.
        budget: env steps for a decision.
        iterations: how often the samples' distribution is fitted.
        replan_every: env steps for which a plan is executed.
    """

    horizon: int | None = None
    budget: int = BUDGET
    iterations: int = ITERATIONS
    replan_every: int = 1


@dataclasses.dataclass(frozen=True)
class Configuration:
    """What is evaluated.

    Attributes:
        task: task name, as in `registry.find`.
        policy: one of `POLICIES`, or a saved one, see `baselines.policies`.
        variations: indices.
        seeds: of the policy: the score is a mean over variations, its spread is over seeds.
        settings: keyword arguments of the task that JSON can hold, such as actor and fidelity.
        planning: of a planner; None for other policies.
    """

    task: str
    policy: str
    variations: tuple[int, ...]
    seeds: tuple[int, ...] = (0,)
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    planning: Planning | None = None

    def __post_init__(self):
        registry.find(self.task)
        if not is_saved(self.policy) and self.policy not in POLICIES:
            choices = (*POLICIES, "FILE.pt2", "MODULE:FUNCTION")
            raise UnknownNameError("policy", self.policy, choices)
        for variation in self.variations:
            check_variation(variation)
        check_count("number of variations", len(set(self.variations)), 1)
        check_count("number of seeds", len(set(self.seeds)), 1)
        if self.policy in PLANNERS:
            planning = self.planning or Planning()
            usual = usual_horizon(self.task)
            horizon = usual if planning.horizon is None else planning.horizon
            planning = dataclasses.replace(planning, horizon=horizon)
            object.__setattr__(self, "planning", planning)
            _planner(self)
            check_count("replan_every", planning.replan_every, 1, horizon)
        elif self.planning is not None:
            raise ResultError(f"planning is for {', '.join(PLANNERS)}, not for {self.policy!r}")

    @property
    def episodes(self) -> list[tuple[int, int]]:
        """(variation, seed) of every episode."""
        return [(variation, seed) for seed in self.seeds for variation in self.variations]

    def as_json(self) -> dict[str, object]:
        """Everything that the scores depend on."""
        return {
            "protocol": PROTOCOL,
            "task": self.task,
            "policy": self.policy,
            "variations": list(self.variations),
            "seeds": list(self.seeds),
            "settings": dict(self.settings),
            "planning": None if self.planning is None else dataclasses.asdict(self.planning),
            "versions": {
                "softgym_mj": softgym_mj.__version__,
                "mujoco": mujoco.__version__,
                "numpy": np.__version__,
                "python": platform.python_version(),
            },
        }


def _planner(configuration: Configuration):
    planning = configuration.planning
    assert planning is not None
    return make_planner(
        configuration.policy,
        configuration.task,
        planning.horizon,
        budget=planning.budget,
        iterations=planning.iterations,
    )


def evaluation_variations(number: int) -> tuple[int, ...]:
    """The first `number` evaluation variations."""
    indices = split_indices("evaluate")
    check_count("number of variations", number, 1, len(indices))
    return tuple(indices[:number])


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
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> dict:
    """Plays all episodes that `folder` does not hold yet, and writes `folder`/result.json.

    Planners share out their samples to the workers, other policies their episodes.

    Args:
        configuration: what is evaluated.
        folder: of this evaluation alone. It knows tasks by name: what has changed since, in a task
            of your own or in a policy, needs another folder.
        workers: who simulates; None for this process.
        progress: told of episodes and decisions.

    Returns:
        The content of the result.

    Raises:
        ResultError: if the folder belongs to another configuration or holds a damaged file.
    """
    folder, workers, progress = pathlib.Path(folder), workers or Here(), progress or Progress()
    written = configuration.as_json()
    _claim(folder, written)
    episodes: dict[tuple[int, int], dict] = {}
    missing = []
    for variation, seed in configuration.episodes:
        file = _episode_file(folder, variation, seed)
        if file.exists():
            episodes[variation, seed] = read_json(file)
            progress.on_episode(episodes[variation, seed])
        else:
            missing.append((variation, seed))
    for variation, seed, episode in _played(configuration, missing, folder, workers, progress):
        write_json(_episode_file(folder, variation, seed), episode)
        episodes[variation, seed] = episode
        progress.on_episode(episode)
    ordered = [episodes[key] for key in configuration.episodes]
    result = {**written, "summary": summary(ordered), "episodes": ordered}
    write_json(folder / "result.json", result)
    return result


def _played(
    configuration: Configuration,
    missing: Sequence[tuple[int, int]],
    folder: pathlib.Path,
    workers: Workers,
    progress: Progress,
) -> Iterable[tuple[int, int, dict]]:
    settings = json.dumps(dict(configuration.settings), sort_keys=True)
    if configuration.policy not in PLANNERS:
        task = sent_to(workers, configuration.task)
        calls = [(task, settings, configuration.policy, *key) for key in missing]
        for index, episode in workers.results(play_episode, calls):
            yield *missing[index], episode
        return
    planning = configuration.planning
    assert planning is not None
    # Not `kept_environment`: in this process the samples are played in that one.
    env = registry.load(
        configuration.task, split="all", observation="reduced", **dict(configuration.settings)
    )
    rollouts = Rollouts(configuration.task, configuration.settings, workers)
    for variation, seed in missing:
        policy = ModelPredictivePolicy(
            env,
            _planner(configuration),
            rollouts,
            seed=seed,
            replan_every=planning.replan_every,
            journal=_episode_file(folder, variation, seed).with_suffix(".jsonl"),
            on_decision=progress.on_decision,
        )
        yield variation, seed, _play(env, policy, variation, seed)


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


def summary(episodes: Sequence[Mapping]) -> dict[str, float]:
    """The paper's numbers: each seed's mean over variations, their median and quartiles."""
    scores: dict[int, list[float]] = {}
    for episode in episodes:
        scores.setdefault(episode["seed"], []).append(episode["normalized_performance"])
    means = [float(np.mean(values)) for values in scores.values()]
    every = [score for values in scores.values() for score in values]
    low, median, high = np.percentile(means, [25, 50, 75]).tolist()
    return {
        "median": median,
        "percentile_25": low,
        "percentile_75": high,
        "mean": float(np.mean(every)),
        "min": min(every),
        "max": max(every),
        "success_rate": float(np.mean([episode["success"] for episode in episodes])),
    }


# ---------------------------------------------------------------------- files


def _episode_file(folder: pathlib.Path, variation: int, seed: int) -> pathlib.Path:
    return folder / "episodes" / f"{variation:04d}_seed{seed}.json"


def _claim(folder: pathlib.Path, written: dict) -> None:
    """Makes a folder one of this configuration."""
    file = folder / "configuration.json"
    if file.exists():
        found = read_json(file)
        if found != written:
            differ = sorted(key for key in written if found.get(key) != written[key])
            raise ResultError(
                f"{folder} holds an evaluation with another {', '.join(differ)}; choose another "
                "folder or delete it"
            )
        return
    write_json(file, written)


def write_json(file: pathlib.Path, content: dict) -> None:
    """Writes a file whole or not at all."""
    write_whole(file, (json.dumps(content, indent=2) + "\n").encode())


def read_json(file: pathlib.Path) -> dict:
    """Reads what `write_json` wrote.

    Raises:
        ResultError: if it is no JSON object.
    """
    try:
        content = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise ResultError(f"{file} cannot be read: {error}") from error
    if not isinstance(content, dict):
        raise ResultError(f"{file} is not a result")
    return content
