"""`softgym-mj record`, and which episodes commands play."""

import inspect
import re
import shlex

import minari
import numpy as np
import pytest

from softgym_mj import recording, registry
from softgym_mj.cli import data
from tests.command import output_of, status_of

pytestmark = pytest.mark.usefixtures("own_datasets")


def test_the_command_line_records():
    command = "record straighten_rope --policy random --episodes 2 --seed 3 --task-settings"
    output_of(*command.split(), '{"horizon": 5}')
    dataset = minari.load_dataset("softgym_mj/straighten_rope/random-v0")
    first, second = dataset.iterate_episodes()
    assert len(first) == len(second) == 5
    assert not np.array_equal(first.actions, second.actions)


def test_the_command_line_chooses(capsys, monkeypatch):
    command = "record straighten_rope --variations 892-894 --dataset rope-v0"
    command += " --successful-only --author me --task-settings"
    command += """ '{"num_pickers": 2, "horizon": 20}'"""
    assert status_of(shlex.split(command), monkeypatch) == 0
    dataset = minari.load_dataset("rope-v0")
    assert 0 < len(dataset) < 3
    assert all(episode.infos["success"][-1] for episode in dataset)
    assert {int(episode.infos["variation"][0]) for episode in dataset} < {892, 893, 894}
    assert f"dropped {3 - len(dataset)} without success" in capsys.readouterr().out
    settings = {"num_pickers": 2, "horizon": 20, "observation": "reduced", "split": "evaluate"}
    assert dataset.env_spec.kwargs == {"task": "straighten_rope", **settings}
    assert dataset.storage.metadata["author"] == {"me"}


def test_the_command_line_disturbs(capsys, monkeypatch):
    command = "record straighten_rope --episodes 2 --noise 0.3 --jobs 2 --task-settings"
    assert status_of(shlex.split(f"""{command} '{{"horizon": 4}}'"""), monkeypatch) == 0
    dataset = minari.load_dataset("softgym_mj/straighten_rope/scripted-noise0-3-v0")
    for episode in dataset:
        own = episode.infos["expert_action"]
        assert own.shape == (4, 8) and not np.array_equal(own, episode.actions)
    assert status_of(shlex.split("record straighten_rope --noise 2"), monkeypatch) == 1
    assert "noise=2.0 is not valid: expected a number in 0..1" in capsys.readouterr().err


def test_all_tasks_by_one_command(capsys, monkeypatch):
    command = "record all --episodes 2 --policy zero --task-settings"
    settings = """ '{"horizon": 2}'"""
    played, record = [], recording.record

    def stops(task, *arguments, **settings):
        if task == "pour_water" and task not in played:
            played.append(task)
            raise KeyboardInterrupt
        played.append(task)
        return record(task, *arguments, **settings)

    names = ["spread_cloth", "pour_water", "straighten_rope"]
    monkeypatch.setattr(data, "TASKS", {name: registry.TASKS[name] for name in names})
    place = names.index("pour_water")
    stops.__signature__ = inspect.signature(record)
    monkeypatch.setattr(recording, "record", stops)
    assert status_of(shlex.split(command + settings), monkeypatch) == 130
    assert played == names[: place + 1]
    assert "0 episodes of pour_water are stored" in capsys.readouterr().err
    assert status_of(shlex.split(command + settings), monkeypatch) == 0
    assert played == [*names[: place + 1], *names]
    assert capsys.readouterr().out.count("exists already") == place
    for name in names:
        dataset = minari.load_dataset(f"softgym_mj/{name}/zero-v0")
        assert [len(episode) for episode in dataset] == [2, 2]
        assert dataset.env_spec.kwargs["task"] == name
    assert status_of(shlex.split(f"{command} '{{\"horizon\": 3}}'"), monkeypatch) == 1
    error = capsys.readouterr().err
    assert f"dataset='softgym_mj/{names[0]}/zero-v0' exists with different settings;" in error
    assert status_of(shlex.split("record all --dataset all-v0"), monkeypatch) == 1
    assert "dataset='all-v0' is not valid" in capsys.readouterr().err


def test_formats_by_the_command_line(capsys, monkeypatch):
    for options, message in (
        ("--format csv", "format='csv' is unknown; valid choices: 'minari', 'lerobot'"),
        ("--codec h264", "codec='h264' is not valid: expected None with format='minari'"),
        ("--format lerobot --codec vp9", "codec='vp9' is unknown; valid choices: 'libsvtav1'"),
        ("--format lerobot --author me", "author, author_email, code_permalink=('me', None, None)"),
    ):
        assert status_of(shlex.split(f"record straighten_rope {options}"), monkeypatch) == 1
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("record straighten_rope --episodes 0", r"episodes=0 .*1\.\.800"),
        ("record straighten_rope --variations 999-1000", r"variations='999-1000' .*0\.\.999"),
        ("record straighten_rope --variation 3 --episodes 1", "--variations .* with --episodes$"),
        ("rollout straighten_rope --variation 3 --split all", "--variations .* with --split$"),
        ("rollout straighten_rope --variation 1200 --episodes 1", r"variations='1200' .*0\.\.999"),
        ("record straighten_rope --split every", "split='every'"),
        ("record straighten_rope --task-settings [1]", "task_settings='.1.' .*a JSON object"),
        ("""record straighten_rope --task-settings '{"seed": 1}'""", "task_settings=.*not 'seed'"),
        ("rollout straighten_rope --split train --episodes 801", r"episodes=801 .*1\.\.800"),
        ("evaluate straighten_rope --episodes 201", r"201 .*1\.\.200"),
        ("generate straighten_rope --start 999 --num 2", r"variation=1000 .*0\.\.999"),
        ("rollout nonsense", "task='nonsense' .*'spread_cloth'"),
        ("demo --variation 1000", r"variation=1000 .*0\.\.999"),
    ],
)
def test_what_does_not_exist_is_not_played(arguments, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert status_of(shlex.split(arguments), monkeypatch) == 1
    error = capsys.readouterr().err
    assert re.match(rf"InvalidArgumentError: .*{message}", error), error
    assert error.count("\n") == 1
