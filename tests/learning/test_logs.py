"""Logs have the numbers of curves."""

import pathlib
import sys
import types

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.logs import make_log


def test_tensorboard_has_losses_scores_and_success(tmp_path):
    training = types.SimpleNamespace(seeds=[3, 7], env_steps=100, rows=[])
    for env_steps in (100, 200):  # Two evaluations, each logged once.
        for seed in training.seeds:
            for split in ("train", "evaluate"):
                score = env_steps / 1000.0 + seed / 100.0
                row = {"split": split, "seed": seed, "env_steps": env_steps}
                training.rows.append({**row, "normalized_performance": score, "success": 0.25})
    log = make_log("tensorboard", tmp_path)
    for training.env_steps in (100, 150, 200):
        log(training, {"critic_loss": [0.5, 1.5]})
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    splits = [f"{s}/{n}/{k}" for s in ("train", "evaluate")
              for n in ("normalized_performance", "success") for k in (3, 7)]  # fmt: skip
    assert {*events.Tags()["scalars"]} == {"critic_loss/3", "critic_loss/7", *splits}
    scores = events.Scalars("evaluate/normalized_performance/7")
    assert [(one.step, one.value) for one in scores] == [
        (100, pytest.approx(0.17)),
        (200, pytest.approx(0.27)),
    ]
    assert [one.value for one in events.Scalars("train/success/3")] == [0.25, 0.25]
    assert [one.step for one in events.Scalars("critic_loss/7")] == [100, 150, 200]


def test_each_folder_has_a_run_of_its_own_that_continues(tmp_path, monkeypatch):
    runs = []
    monkeypatch.setitem(
        sys.modules, "wandb", types.SimpleNamespace(init=lambda **run: runs.append(run))
    )
    folders = [tmp_path / parent / "training" for parent in "ab"]
    for folder in folders:
        folder.mkdir(parents=True)
        make_log("wandb", folder)
    monkeypatch.chdir(folders[0])
    make_log("wandb", pathlib.Path())
    first, other, again = (run["id"] for run in runs)
    assert again == first != other and len(first) == 32
    assert {run["name"] for run in runs} == {"training"}


def test_another_log_is_refused(tmp_path):
    with pytest.raises(InvalidArgumentError, match="'tensorboard'"):
        make_log("csv", tmp_path)
