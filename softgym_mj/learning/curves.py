"""Curves: how well each seed did, a row of each evaluation and split."""

import csv
import io
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.storage.files import write_whole
from softgym_mj.variations.indices import SPLITS

COLUMNS = (
    "task", "method", "observation", "preset", "replay", "seed", "env_steps", "updates", "seconds",
    "split", "episodes", "normalized_performance", "success", "final",
)  # fmt: skip
FILE = "curve.csv"  # In the folder of a training.
CARD = "card.json"
EPISODES = "episodes.csv"  # Of the last evaluation, held out.
POLICY = "policy_{seed}.pt2"
# Of an episode's infos, those that there are.
_KEPT = (
    "normalized_performance", "performance", "success", "episode_max_edge_strain",
    "spilled",
)  # fmt: skip


def evaluated(number: int) -> dict[str, range]:
    """Returns so many variations of each split, evenly chosen: what an evaluation plays."""
    splits = {split: SPLITS[split] for split in ("train", "evaluate")}
    return {split: own[:: len(own) // number][:number] for split, own in splits.items()}


def named(observation: Any) -> Any:
    """What curves call an observation, or several: rgb+held."""
    return "+".join(map(str, observation)) if isinstance(observation, list | tuple) else observation


def curve_rows(
    common: Mapping[str, Any], seeds: Sequence[int], infos: Mapping[str, np.ndarray]
) -> list[dict[str, Any]]:
    """Returns the rows of an evaluation.

    Args:
        common: what they have in common, by `COLUMNS`.
        seeds: a row of each.
        infos: how episodes ended (seeds, variations), by name.
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
    """Writes rows by `COLUMNS` to `folder`/curve.csv: all of it or nothing."""
    _write(folder / FILE, COLUMNS, rows)


def write_episodes(
    folder: pathlib.Path,
    seeds: Sequence[int],
    variations: Sequence[int],
    infos: Mapping[str, np.ndarray],
) -> None:
    """Writes how each episode ended, infos (seeds, variations), to `folder`/episodes.csv."""
    names = [name for name in _KEPT if name in infos]
    rows = [
        {"seed": seed, "variation": variation, **{name: infos[name][k, i] for name in names}}
        for k, seed in enumerate(seeds)
        for i, variation in enumerate(variations)
    ]
    _write(folder / EPISODES, ["seed", "variation", *names], rows)


def _write(file: pathlib.Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(file, text.getvalue().encode())
