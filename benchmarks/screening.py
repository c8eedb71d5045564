"""Settings of SAC side by side, each a seed's own: which are worth a training of more seeds?

    python -m benchmarks.screening fold_cloth --out build/screening \\
        --settings '{"observation": "markov", "env_steps": 409600}' \\
        --vary '{"discount": [0.95, 0.95, 0.98, 0.98], "added": [3, 1, 3, 1]}'

On a GPU ten settings cost little more than one. A list has a number for each seed; seeds differ in
what they draw, too, so that small differences say nothing.
"""

import argparse
import collections
import dataclasses
import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch

from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_name
from softgym_mj.learning import checkpoints
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.sac import make
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.registry import find_preset
from softgym_mj.learning.training import Training

LAST = 2  # Evaluations, whose mean is a score: one alone is of few episodes.
OF_REPLAYS, OF_SAC = ("discount", "added"), ("target_entropy", "pessimism")
VARIED = (*OF_REPLAYS, *OF_SAC)
Varied = Mapping[str, Sequence[float]]


def varied(learner: OffPolicy, vary: Varied) -> OffPolicy:
    """Gives each seed its own numbers.

    Args:
        learner: of SAC, as many seeds as there are numbers; its setting `added` is the largest one.
        vary: by the name of a setting, one of `VARIED`.
    """
    for name, values in vary.items():
        owner = learner.algorithm if name in OF_SAC else learner.replay
        each = torch.tensor(values, device=learner.replay.discount.device)[:, None]
        setattr(owner, name, each)
    return learner


def screen(
    task: str, preset: str, settings: Mapping[str, Any], vary: Varied, folder: pathlib.Path,
    device: str,
) -> list[float]:  # fmt: skip
    """Trains a seed with each of the numbers; returns their scores.

    Raises:
        InvalidArgumentError: for what does not vary, or lists of different lengths.
        StoreError: if the folder has a training: it does not know of which numbers.
    """
    if (folder / checkpoints.FILE).exists():
        raise StoreError(f"{folder} has a training: choose another folder")
    for name in vary:
        check_name("vary", name, VARIED)
    lengths = {len(values) for values in vary.values()}
    if len(lengths) != 1:
        raise InvalidArgumentError("vary", dict(vary), "lists of as many numbers each")
    # Numbers are checked one by one, as settings.
    for numbers in zip(*vary.values(), strict=True):
        find_preset("sac", preset, task, **{**settings, **dict(zip(vary, numbers, strict=True))})
    if "discount" in vary and settings.get("last_discount") is not None:
        raise InvalidArgumentError("last_discount", settings["last_discount"], "none: it varies")
    most = {"added": max(vary["added"])} if "added" in vary else {}
    training, method = find_preset("sac", preset, task, **{**settings, **most})

    def make_varied(settings: Any, problem: Problem) -> OffPolicy:
        return varied(make(settings, problem), vary)

    own = dataclasses.replace(method, make=make_varied)
    (number,) = lengths
    run = Training(training, own, range(number), folder, device)
    run.run(_tell)
    return scores(run, LAST)


def scores(run: Training, last: int) -> list[float]:
    """Of each seed: means over all episodes of so many last evaluations."""
    evaluations = sorted({row["env_steps"] for row in run.rows})[-last:]
    found = collections.defaultdict(list)
    for row in run.rows:
        if row["env_steps"] in evaluations:
            found[row["seed"]] += [row["normalized_performance"]] * row["episodes"]
    return [float(np.mean(found[seed])) for seed in run.seeds]


def _tell(now: Training, news: Mapping[str, Any]) -> None:
    print(now.env_steps, *(f"{score:.3f}" for score in scores(now, 1)), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--settings", type=json.loads, default={})
    parser.add_argument("--vary", type=json.loads, required=True)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    own = parser.parse_args()
    found = screen(own.task, own.preset, own.settings, own.vary, own.out, own.device)
    result = {"settings": own.settings, "vary": own.vary, "scores": found}
    (own.out / "screening.json").write_text(json.dumps(result, indent=1) + "\n")
    for k, score in enumerate(found):
        print(f"{score:.3f}", {name: values[k] for name, values in own.vary.items()})


if __name__ == "__main__":
    main()
