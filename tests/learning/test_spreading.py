"""Seeds that are trained apart: their oracle is the same seeds side by side."""

import dataclasses
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.jobs.executors import SerialExecutor
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.results import read_rows
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.spreading import train_each
from softgym_mj.learning.training import Training

METHOD = find_method("sac", hidden=(8, 8), random_steps=4, updates=2, batch=4, replay=16)
SETTINGS = TrainingSettings(
    "straighten_rope",
    env_steps=8,
    worlds=2,
    part=8,
    episodes=1,
    final_episodes=1,
    fidelity="fast",
    episode_steps=6,
)


def test_seeds_apart_are_those_side_by_side(tmp_path):
    ended = []
    rows = train_each(
        SETTINGS, METHOD, [0, 1], tmp_path / "apart", "host", None, SerialExecutor(),
        lambda seed, own: ended.append((seed, len(own))),
    )  # fmt: skip
    assert ended == [(0, 2), (1, 2)]
    both = Training(SETTINGS, METHOD, [0, 1], tmp_path / "both", "host")
    both.run()
    keys = ("seed", "split", "env_steps", "updates", "episodes", "final")
    assert [[row[key] for key in keys] for row in rows] == [
        [row[key] for key in keys] for row in both.rows
    ]
    for own, expected in zip(rows, both.rows, strict=True):
        score = "normalized_performance"
        np.testing.assert_allclose(own[score], expected[score], atol=1e-3)
    kept = read_rows(tmp_path / "apart" / "curve.csv")
    scores = {(row["seed"], row["split"]): row["normalized_performance"] for row in rows}
    assert {(row.seed, row.split): row.normalized_performance for row in kept} == scores
    assert (tmp_path / "apart" / "seed_1" / "policy_1.pt2").exists()


@pytest.mark.long
def test_the_command_trains_in_processes(tmp_path):
    both = {**dataclasses.asdict(SETTINGS), **dataclasses.asdict(METHOD.settings)}
    settings = json.dumps({name: value for name, value in both.items() if name != "task"})
    command = ["train", "sac", "straighten_rope", "--device", "host"]
    command += ["--jobs", "2", "--settings", settings, "--out", str(tmp_path)]
    done = CliRunner().invoke(commands.app, command)
    assert done.exit_code == 0, done.output
    assert {row.seed for row in read_rows(tmp_path / "curve.csv")} == {0}
