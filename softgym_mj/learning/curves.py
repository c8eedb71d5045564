"""Learning curves: a row for each evaluation, seed and split."""

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.storage.files import write_csv
from softgym_mj.variations.indices import SPLITS

COLUMNS = (
    "task", "actor", "method", "observation", "preset", "replay", "seed", "env_steps", "updates",
    "seconds", "split", "episodes", "normalized_performance", "success", "final",
)  # fmt: skip
DEFAULT_ACTOR = "default"  # Name in curves of the first of a task's `actors`.
FILE = "curve.csv"  # File in the folder of a training.
CARD = "card.json"
EPISODES = "episodes.csv"  # File of the last evaluation's held-out episodes.
POLICY = "policy_{seed}.pt2"
# Infos of episodes, as far as the task has them.
_KEPT = (
    "normalized_performance", "performance", "success", "episode_max_edge_strain",
    "spilled",
)  # fmt: skip


def evaluated(number: int) -> dict[str, range]:
    """Returns `number` evenly spaced variations of each split, for an evaluation."""
    splits = {split: SPLITS[split] for split in ("train", "evaluate")}
    return {split: own[:: len(own) // number][:number] for split, own in splits.items()}


def named(observation: Any) -> Any:
    """Returns the name of one or several observations in curves, such as "rgb+held"."""
    return "+".join(map(str, observation)) if isinstance(observation, list | tuple) else observation


def curve_rows(
    common: Mapping[str, Any], seeds: Sequence[int], infos: Mapping[str, np.ndarray]
) -> list[dict[str, Any]]:
    """Returns the rows of an evaluation.

    Args:
        common: Common entries by `COLUMNS`.
        seeds: Seeds, one row each.
        infos: Infos at the end of episodes (seeds, variations), by name.
    """
    scores = {name: infos[name].mean(1) for name in ("normalized_performance", "success")}
    return [
        {
            **common, "seed": seed, "episodes": infos["success"].shape[1],
            **{name: float(each[k]) for name, each in scores.items()},
        }
        for k, seed in enumerate(seeds)
    ]  # fmt: skip


def write_curve(folder: pathlib.Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes rows by `COLUMNS` to `folder`/curve.csv atomically."""
    write_csv(folder / FILE, COLUMNS, rows)


def write_episodes(
    folder: pathlib.Path,
    seeds: Sequence[int],
    variations: Sequence[int],
    infos: Mapping[str, np.ndarray],
) -> None:
    """Writes infos at the end of episodes (seeds, variations) to `folder`/episodes.csv."""
    names = [name for name in _KEPT if name in infos]
    rows = [
        {"seed": seed, "variation": variation, **{name: infos[name][k, i] for name in names}}
        for k, seed in enumerate(seeds)
        for i, variation in enumerate(variations)
    ]
    write_csv(folder / EPISODES, ["seed", "variation", *names], rows)
