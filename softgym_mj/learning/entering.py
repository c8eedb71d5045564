"""Rules for results that are merged with the published ones: `learning table --merge`.

A result is a folder with curve.csv (columns `curves.COLUMNS`), episodes.csv (the held-out episodes
of the last evaluation) and card.json. docs/evaluation.md describes these files.
"""

import csv
import io
import math
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.learning.curves import CARD, DEFAULT_ACTOR, EPISODES, FILE, named
from softgym_mj.learning.registry import METHODS, find_preset
from softgym_mj.learning.results import Row, read_folder
from softgym_mj.storage.files import naming, read_json, read_whole
from softgym_mj.variations.indices import SPLITS

HELD_OUT = SPLITS["evaluate"]
# Normalized performance; a cloth that grips stretch covers up to 0.35 % more than a flat one.
HIGHEST_SCORE = 1.005
# Minimum number of seeds of a result, and of one whose training takes this many seconds of a GPU.
SEEDS, SEEDS_IF_LONG, LONG = 5, 3, 300.0
_ROUNDING = 1e-6  # Rounding error of scores in text files.
_SPLITS = ("train", "evaluate")


def enter(path: pathlib.Path) -> list[Row]:
    """Returns the rows of a result that satisfies all rules.

    Args:
        path: Folder of a training, or folder or file of a planner's evaluation.

    Raises:
        StoreError: for a result that violates rules (the message lists all), or a damaged file.
    """
    rows = read_folder(path)
    broken = [*_bad_scores(rows)]
    if (path / FILE).exists() or path.suffix == ".csv":
        folder = path if path.is_dir() else path.parent
        if (folder / CARD).exists():
            broken += _of_training(rows, read_json(folder / CARD), folder)
        else:
            broken.append(f"there is no {CARD}, the card of the training")
    if broken:
        raise StoreError(f"{path} is not merged: {'; '.join(broken)}")
    return rows


def _bad_scores(rows: Sequence[Row]) -> Iterator[str]:
    if not rows:
        yield "it has no rows"
    for row in rows:
        score = row.normalized_performance
        if not (math.isfinite(score) and score <= HIGHEST_SCORE):
            where = f"seed {row.seed}, {row.env_steps:,} env steps, {row.split}"
            yield f"the score {score:g} ({where}) is above 1"
            return


def _of_training(
    rows: Sequence[Row], card: Mapping[str, Any], folder: pathlib.Path
) -> Iterator[str]:
    """Yields descriptions of the rules that a training violates."""
    training = card.get("training")
    training = training if isinstance(training, Mapping) else {}
    own = {
        "task": training.get("task"), "actor": training.get("actor") or DEFAULT_ACTOR,
        "method": card.get("method"), "preset": card.get("preset"),
        "observation": named(training.get("observation")),
    }  # fmt: skip
    for name, value in own.items():
        result = sorted({getattr(row, name) for row in rows})
        if result != [value]:
            yield f"{name} is {', '.join(result)} in {FILE} and {value!r} in {CARD}"
    yield from _bad_task(training)
    seeds, points = sorted({row.seed for row in rows}), card.get("evaluations")
    if seeds != card.get("seeds"):
        yield f"seeds are {seeds} in {FILE} and {card.get('seeds')} in {CARD}"
    yield from _bad_seeds(seeds, card)
    if not _are_counts(points):
        yield f"{CARD} does not list the env steps of all evaluations as 'evaluations'"
        return
    assert isinstance(points, list)
    yield from _bad_length(points, own, training)
    yield from _missing(rows, seeds, points)
    yield from _bad_episodes(rows, folder / EPISODES)


def _bad_task(training: Mapping[str, Any]) -> Iterator[str]:
    """Yields the settings by which the task differs from the table's."""
    usual: dict[str, Any] = {"fidelity": "default", "episode_steps": None, "arguments": {}}
    for name, value in usual.items():
        if (result := training.get(name, value)) != value:
            yield f"the task is not the table's: {name} is {result!r}"


def _bad_seeds(seeds: Sequence[int], card: Mapping[str, Any]) -> Iterator[str]:
    seconds = card.get("seconds")
    if not isinstance(seconds, int | float):
        yield f"seconds in {CARD} are {seconds!r}, not a number"
        return
    is_long = card.get("backend") == "cuda" and seconds >= LONG
    least = SEEDS_IF_LONG if is_long else SEEDS
    if len(seeds) < least or [*seeds] != [*range(len(seeds))]:
        yield f"there are seeds {[*seeds]}, not 0 to {least - 1} or more"


def _are_counts(points: object) -> bool:
    counts = points if isinstance(points, list) else [None]
    return bool(counts) and all(type(point) is int and point >= 0 for point in counts)


def _bad_length(
    points: Sequence[int], own: Mapping[str, Any], training: Mapping[str, Any]
) -> Iterator[str]:
    """Yields violations unless the training has ended, and is as long as its preset."""
    planned = training.get("env_steps", points[-1])
    if points[-1] != planned:
        yield f"the training has ended after {points[-1]} of {planned} env steps"
    if own["method"] not in METHODS or own["preset"] == "custom":
        return
    try:
        preset, _ = find_preset(
            own["method"], own["preset"], own["task"], observation=training.get("observation")
        )
    except InvalidArgumentError as error:
        yield str(error)
        return
    if planned != preset.env_steps:
        yield f"env steps are {planned}, and {preset.env_steps} in the preset"


def _missing(rows: Sequence[Row], seeds: Sequence[int], points: Sequence[int]) -> Iterator[str]:
    """Yields violations for missing or additional evaluations."""
    result = {(row.env_steps, row.seed, row.split) for row in rows}
    expected = {(at, seed, split) for at in points for seed in seeds for split in _SPLITS}
    if missing := sorted(expected - result):
        at, seed, split = missing[0]
        yield (
            f"the curve is not whole: {len(missing)} of {len(expected)} rows are missing, such as "
            f"that of seed {seed}, {at:,} env steps, {split}"
        )
    if more := sorted(result - expected):
        yield f"{len(more)} rows are of evaluations that {CARD} does not list, such as {more[0]}"
    for row in rows:
        if row.final != (row.env_steps == points[-1]):
            yield f"rows are final before the last of {points[-1]:,} env steps, or not there"
            return
    episodes = {row.episodes for row in rows if row.final and row.split == "evaluate"}
    if episodes != {len(HELD_OUT)}:
        yield f"final rows are of {sorted(episodes)} held-out episodes, not {len(HELD_OUT)}"


def _bad_episodes(rows: Sequence[Row], file: pathlib.Path) -> Iterator[str]:
    """Yields violations unless final rows are the means of the listed episodes."""
    if not file.exists():
        yield f"there is no {file.name}, how each held-out episode ended"
        return
    scores: dict[int, dict[int, tuple[float, float]]] = {}
    with naming(file, "read"):
        lines = csv.DictReader(io.StringIO(read_whole(file).decode(), newline=""))
        try:
            for line in lines:
                own = scores.setdefault(int(line["seed"]), {})
                numbers = float(line["normalized_performance"]), float(line["success"])
                own[int(line["variation"])] = numbers
        except (csv.Error, LookupError, TypeError, ValueError) as error:
            raise ValueError(f"line {lines.line_num}: {error}") from error
    for row in rows:
        if not (row.final and row.split == "evaluate"):
            continue
        own = scores.get(row.seed, {})
        if sorted(own) != [*HELD_OUT]:
            yield f"{file.name} does not have variations 800 to 999 of seed {row.seed}, once each"
            continue
        means = [math.fsum(column) / len(own) for column in zip(*own.values(), strict=True)]
        pairs = zip(means, (row.normalized_performance, row.success), strict=True)
        if not all(abs(mean - value) <= _ROUNDING for mean, value in pairs):
            yield (
                f"seed {row.seed} has {row.normalized_performance:g} in {FILE}, and "
                f"{means[0]:g} is the mean of {file.name}"
            )
        if max(score for score, _ in own.values()) > HIGHEST_SCORE:
            yield f"scores of seed {row.seed} in {file.name} are above 1"
