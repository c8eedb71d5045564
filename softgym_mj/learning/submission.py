"""Scores policies that were trained by other code: `softgym-mj learning submit`.

The folder has card.json and the exported policy of each seed; docs/evaluation.md describes them. An
existing curve keeps its earlier rows; final rows come from the evaluation here.
"""

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softgym_mj.evaluation import Configuration, Progress, evaluate
from softgym_mj.exceptions import StoreError
from softgym_mj.learning.curves import (
    CARD,
    DEFAULT_ACTOR,
    FILE,
    POLICY,
    evaluated,
    named,
    write_episodes,
)
from softgym_mj.learning.results import Name, Row, read_rows, write_rows
from softgym_mj.parallel.executors import Executor
from softgym_mj.policies.exported import has_images
from softgym_mj.storage.files import read_json
from softgym_mj.variations.indices import SPLITS

EVALUATION = "evaluation"  # Folder of finished episodes.
_TRAINING = "task", "observation"
_VALID = {
    "method": (str, "a name"), "preset": (str, "a name"), "updates": (int, "a whole number"),
    "seconds": (int | float, "a number"), "seeds": (list, "a list of whole numbers"),
    "evaluations": (list, "a list of env steps"), "training": (dict, "an object"),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Submission:
    """Folder of policies to be evaluated.

    Attributes:
        folder: Folder with card.json and the policies.
        name: Name of the result.
        seeds: Seeds of the policies.
        env_steps, updates, seconds: Training of each seed; seconds of seeds trained together.
        configuration: Evaluation of 200 held-out and 200 training variations.
    """

    folder: pathlib.Path
    name: Name
    seeds: tuple[int, ...]
    env_steps: int
    updates: int
    seconds: float
    configuration: Configuration


def variations() -> dict[str, range]:
    """Returns all held-out variations and as many training variations, by split."""
    return evaluated(len(SPLITS["evaluate"]))


def read_submission(folder: pathlib.Path) -> Submission:
    """Reads the card of a folder.

    Raises:
        StoreError: for a missing or incomplete card (the message names the entry), or a missing
            policy file.
        InvalidArgumentError: for an unknown task, or a policy with another observation.
    """
    card, file = read_json(folder / CARD), folder / CARD
    for key, (kind, valid) in _VALID.items():
        if not isinstance(card.get(key), kind) or isinstance(card[key], bool):
            raise StoreError(f"{file}: {key}={card.get(key)!r} is not valid: expected {valid}")
    for key in ("seeds", "evaluations"):
        if not card[key] or not all(type(each) is int and each >= 0 for each in card[key]):
            raise StoreError(f"{file}: {key}={card[key]!r} is not valid: expected {_VALID[key][1]}")
    training, seeds = card["training"], tuple(card["seeds"])
    if missing := [key for key in _TRAINING if key not in training]:
        raise StoreError(f"{file}: training lacks {', '.join(missing)}")
    for seed in seeds:
        if not (folder / POLICY.format(seed=seed)).is_file():
            raise StoreError(f"{folder} has no {POLICY.format(seed=seed)}, the policy of this seed")
    seen = training["observation"]
    own = card.get("settings")  # Of a method of this package.
    is_symmetric = isinstance(own, dict) and own.get("symmetric") is True
    replay = str(training.get("replay", "symmetric" if is_symmetric else "plain"))
    configuration = Configuration(
        training["task"],
        str(folder / POLICY),
        tuple(index for own in variations().values() for index in own),
        seeds,
        _settings(training, seen),
    )
    actor = configuration.settings.get("actor", DEFAULT_ACTOR)
    return Submission(
        folder,
        Name(configuration.task, actor, card["method"], named(seen), card["preset"], replay),
        seeds,
        max(card["evaluations"]),
        card["updates"],
        card["seconds"],
        configuration,
    )


def submit(
    submission: Submission,
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    trust: bool = False,
    device: str = "cpu",
) -> list[Row]:
    """Evaluates the policies and writes curve.csv and episodes.csv; continues interrupted runs.

    Args:
        submission: Policies to evaluate.
        executor, progress, trust, device: Arguments of `evaluation.evaluate`.

    Returns:
        The final rows.

    Raises:
        StoreError: for a curve with later rows, or as in `evaluation.evaluate`.
    """
    folder = submission.folder
    earlier = _earlier(submission)
    result = evaluate(
        submission.configuration, folder / EVALUATION, executor, progress,
        trust=trust, device=device,
    )  # fmt: skip
    scores = {(e["seed"], e["variation"]): e for e in result["episodes"]}
    rows = []
    for split, own in variations().items():
        output = {
            name: np.array([[scores[k, i][name] for i in own] for k in submission.seeds], float)
            for name in ("normalized_performance", "performance", "success")
        }
        if split == "evaluate":
            write_episodes(folder, submission.seeds, own, output)
        for k, seed in enumerate(submission.seeds):
            rows.append(
                Row(
                    *submission.name, seed, submission.env_steps, submission.updates,
                    submission.seconds, split, len(own),
                    float(output["normalized_performance"][k].mean()),
                    float(output["success"][k].mean()), True,
                )
            )  # fmt: skip
    write_rows([*earlier, *rows], folder / FILE)
    return rows


def _settings(training: Mapping[str, Any], seen: str | Sequence[str]) -> dict[str, Any]:
    """Returns arguments of the task."""
    names = ["actor", *["image_size"] * has_images(seen)]
    return {"observation": seen, **{each: training[each] for each in names if training.get(each)}}


def _earlier(submission: Submission) -> list[Row]:
    """Returns rows of the folder's curve before the last evaluation."""
    file = submission.folder / FILE
    rows = read_rows(file) if file.exists() else []
    if later := [row for row in rows if row.env_steps > submission.env_steps]:
        raise StoreError(f"{file} has a row after the last of {CARD}'s evaluations: {later[0]}")
    return [row for row in rows if row.env_steps < submission.env_steps]
