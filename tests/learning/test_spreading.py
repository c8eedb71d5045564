"""Seeds that are trained apart: their oracle is the same seeds side by side."""

import dataclasses
import json

import numpy as np
import pytest

from softgym_mj.exceptions import StoreError
from softgym_mj.learning.joining import join
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.results import read_rows, write_rows
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.spreading import train_each
from softgym_mj.learning.training import Training
from softgym_mj.parallel.executors import SerialExecutor
from tests.command import output_of

METHOD = find_method("sac", hidden=(8, 8), random_steps=4, updates=2, batch=4, replay=16)
SETTINGS = TrainingSettings(
    "straighten_rope",
    env_steps=8,
    num_envs=2,
    part=8,
    episodes=1,
    final_episodes=1,
    fidelity="fast",
    episode_steps=6,
)


def test_seeds_apart_are_those_side_by_side(tmp_path, no_policies):
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


def _trained(folder, seeds, **changes):
    settings = dataclasses.replace(SETTINGS, **changes)
    Training(settings, METHOD, seeds, folder, "host").run()
    return folder


def test_joined_folders_are_one_training_of_all_seeds(tmp_path):
    both = _trained(tmp_path / "both", [3, 4])
    folders = [_trained(tmp_path / str(seed), [seed]) for seed in (4, 3)]
    command = ["learning", "join", *map(str, folders), "--out", str(tmp_path / "out")]
    assert "seeds 3, 4" in " ".join(output_of(*command).split())
    own, expected = read_rows(tmp_path / "out" / "curve.csv"), read_rows(both / "curve.csv")
    assert [row.key for row in own] == [row.key for row in expected]
    cards = [json.loads((path / "card.json").read_text()) for path in (tmp_path / "out", both)]
    for name in ("method", "preset", "training", "settings", "evaluations", "seeds", "env_steps"):
        assert cards[0][name] == cards[1][name]
    apart = [json.loads((folder / "card.json").read_text())["seconds"] for folder in folders]
    assert cards[0]["seconds"] == sum(apart)
    for seed, folder in zip((4, 3), folders, strict=True):
        file = f"policy_{seed}.pt2"
        assert (tmp_path / "out" / file).read_bytes() == (folder / file).read_bytes()
        (line,) = (folder / "episodes.csv").read_text().splitlines()[1:]
        assert line in (tmp_path / "out" / "episodes.csv").read_text().splitlines()


def test_trainings_that_differ_or_have_not_ended_are_not_joined(tmp_path, no_policies):
    first = _trained(tmp_path / "first", [0])
    longer = _trained(tmp_path / "longer", [1], env_steps=16)
    with pytest.raises(StoreError, match=r"training in .*longer.* differ"):
        join([first, longer], tmp_path / "out")
    with pytest.raises(StoreError, match="have seed=0"):
        join([first, first], tmp_path / "out")
    curve = first / "curve.csv"  # As if its final evaluation had been interrupted.
    write_rows([row for row in read_rows(curve) if not row.final], curve)
    with pytest.raises(StoreError, match="first has not ended"):
        join([first], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_the_command_trains_in_processes(tmp_path):
    both = {**dataclasses.asdict(SETTINGS), **dataclasses.asdict(METHOD.settings)}
    settings = json.dumps({name: value for name, value in both.items() if name != "task"})
    command = ["train", "sac", "straighten_rope", "--device", "host"]
    command += ["--jobs", "2", "--settings", settings, "--out", str(tmp_path)]
    output_of(*command)
    assert {row.seed for row in read_rows(tmp_path / "curve.csv")} == {0}
