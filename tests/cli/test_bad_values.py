"""Values that commands refuse by name, and texts of users that are shown as they are."""

import json
import pathlib

import pytest

import softgym_mj
from softgym_mj.cli.console import policy_file
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from tests.command import status_of

RESULTS = pathlib.Path(__file__).parents[2] / "docs" / "results"

ROPE = "straighten_rope"
EVALUATE = ["evaluate", ROPE, "--policy", "zero", "--episodes", "1"]
REFUSED = {
    "range": ["evaluate", ROPE, "--policy", "zero", "--variations", "0-99999999999"],
    "index": ["evaluate", ROPE, "--policy", "zero", "--variations", "3,1000"],
    "twice": ["rollout", ROPE, "--variations", "800,803,799-801"],
    "deep": [*EVALUATE, "--task-settings", "[" * 100_000],
    "horizon": ["evaluate", ROPE, "--policy", "cem", "--task-settings", '{"horizon": "a"}'],
    "seed of rollout": ["rollout", ROPE, "--policy", "random", "--seed", "-1"],
    "seed of record": ["record", ROPE, "--policy", "random", "--seed", "-1"],
    "NaN": ["bench", ROPE, "--seconds", "nan"],
    "infinity": ["bench", ROPE, "--seconds", "inf"],
    "ending": ["photo", ROPE, "--out", "x.zzz"],
    "ending of a film": ["photo", ROPE, "--video", "--out", "x.png"],
    "env step": ["photo", ROPE, "--step", "76"],
    "file as the folder of a picture": ["photo", ROPE, "--out", "file/x.png"],
    "file as the folder of a training": ["train", "sac", ROPE, "--device", "host", "--out", "file"],
    "architecture": ["compile", "--arch", "3"],
    "teacher": ["train", "distill", ROPE, "--teacher", "none.pt2", "--trust"],
    "trust": ["train", "distill", ROPE, "--teacher", str(RESULTS / "policies/fold_cloth-sac.pt2")],
    "no teacher": ["train", "distill", ROPE, "--device", "host"],
    "log": ["train", "sac", ROPE, "--device", "host", "--log", "csv"],
    "log of processes": ["train", "sac", ROPE, "--device", "host", "--jobs", "2", "--log", "wandb"],
    "observations": ["train", "sac", ROPE, "--device", "host", "--observation", "reduced,held"],
    "published outside of a clone": ["evaluate", ROPE, "--policy", "straighten_rope-sac"],
    "more episodes than variations": ["record", ROPE, "--episodes", "900"],
    "policy of a viewer": ["view", ROPE, "--browser", "--port", "0", "--policy", "teleop"],
    "markup of a task": ["rollout", "[/b]"],
    "markup of a number": ["rollout", ROPE, "--episodes", "[/b]"],
    "markup of a folder": ["identify", "cloth", "nowhere[/b]"],
    "no folder": ["identify", "rope"],
}
WORDS = {
    "range": ["variations='0-99999999999'", "0..999"], "index": ["variations='3,1000'", "0..999"],
    "twice": ["variations='800,803,799-801'", "each index once"],
    "deep": ["task_settings=", "JSON"], "horizon": ["horizon='a'"],
    "seed of rollout": ["--seed", "0"], "seed of record": ["--seed", "0"],
    "NaN": ["seconds=nan"], "infinity": ["seconds=inf"],
    "ending": ["out='x.zzz'", ".png"], "ending of a film": ["out='x.png'", ".mp4"],
    "env step": ["step=76", "0..75"],
    "file as the folder of a picture": ["file cannot be written"],
    "file as the folder of a training": ["file cannot be written"],
    "teacher": ["teacher='none.pt2'"], "trust": ["--trust"], "no teacher": ["--teacher"],
    "log": ["log='csv'", "'tensorboard'"], "log of processes": ["log='wandb'", "'none'"],
    "observations": ["observation=", "sac takes one"],
    "architecture": ["architecture='3'", "'90'"], "markup of a task": ["[/b]"],
    "published outside of a clone": ["policy='straighten_rope-sac'", "Results"],
    "more episodes than variations": ["episodes=900", "1..800"],
    "policy of a viewer": ["policy='teleop'", "'teleoperate'"],
    "markup of a number": ["--episodes"], "markup of a folder": ["[/b]"],
    "no folder": ["`folder` is missing"],
}  # fmt: skip

ROOT = RESULTS.parents[1]


def run(arguments, capsys, monkeypatch):
    """Exit status and all that was printed."""
    status, printed = status_of(arguments, monkeypatch), capsys.readouterr()
    return status, printed.out + printed.err


def _never(*_, **__):
    raise AssertionError("this value should have been refused before")


@pytest.mark.parametrize("name", REFUSED)
def test_refused_by_name(name, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    # Nothing expensive comes before: no environment of a training, no episode.
    monkeypatch.setattr(softgym_mj, "make_vec", _never)
    monkeypatch.setattr(Environment, "play", _never)
    status, printed = run(REFUSED[name], capsys, monkeypatch)
    assert status in (1, 2) and "Traceback" not in printed
    assert all(word in printed for word in WORDS[name]), printed


def test_texts_of_users_are_no_markup(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    status, printed = run([*EVALUATE, "--out", "a[/b]"], capsys, monkeypatch)
    assert status == 0 and "a[/b]" in "".join(printed.split())


@pytest.mark.parametrize(("method", "preset"), [("sac", "night"), ("tqc", "fast")])
def test_without_a_gpu_train_prints_the_command_for_a_cpu(
    method, preset, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    status, printed = run(["train", method, ROPE], capsys, monkeypatch)
    assert status == 1
    command = f"`softgym-mj train {method} {ROPE} --preset {preset} --device cpu`"
    assert printed.count("\n") == 1 and command in printed


def test_a_published_policy_is_evaluated_by_name(capsys, monkeypatch, tmp_path):
    """With the observation of its card: images and proprioception, without an option."""
    monkeypatch.chdir(ROOT)
    command = ["evaluate", ROPE, "--policy", "straighten_rope-distill", "--episodes", "1"]
    status = status_of([*command, "--trust", "--out", str(tmp_path)], monkeypatch)
    assert status == 0, capsys.readouterr()
    result = json.loads((tmp_path / "result.json").read_text())
    assert {*result["settings"]["observation"]} == {"rgb", "proprioception", "held"}


def test_a_misspelled_published_policy_lists_the_others(monkeypatch, tmp_path):
    folder = tmp_path / "docs" / "results" / "policies"
    folder.mkdir(parents=True)
    for name in ("straighten_rope-tqc", "straighten_rope-sac"):
        (folder / f"{name}.pt2").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgumentError) as error:
        policy_file("straighten_rope-scc")
    assert str(error.value) == (
        "policy='straighten_rope-scc' is unknown (did you mean 'straighten_rope-sac'?); "
        "valid choices: 'straighten_rope-sac', 'straighten_rope-tqc'."
    )
