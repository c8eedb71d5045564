"""`--actor` and `--grasp` of the command line: the actor that `load` would build."""

import json

import pytest
from typer.testing import CliRunner

import softgym_mj
from softgym_mj.cli import commands, view
from softgym_mj.policies.factory import make_policy

COMMANDS = ("rollout", "oracle", "record", "view")


@pytest.mark.parametrize("grasp", [None, "friction"])
def test_a_rollout_is_played_by_the_actor(grasp):
    command = "rollout straighten_rope --actor sawyer --policy random --episodes 1 --seed 3"
    if grasp is not None:
        command += f" --grasp {grasp}"
    result = CliRunner().invoke(commands.app, command.split())
    assert result.exit_code == 0, result.output
    line = json.loads(result.output)
    env = softgym_mj.load("straighten_rope", actor="sawyer", grasp=grasp, split="evaluate")
    timestep, policy = env.reset(800), make_policy("random", env, 3)
    while not timestep.last():
        timestep = env.step(policy(timestep))
    assert (line["actor"], line["grasp"]) == ("sawyer", grasp)
    assert line["normalized_performance"] == env.info()["normalized_performance"]


def test_scores_name_the_actor(tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "_VIDEO_SIZE", 64)  # Filming takes longer than the episode.
    command = ["oracle", "straighten_rope", "--episodes", "1", "--actor", "franka"]
    result = CliRunner().invoke(commands.app, [*command, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    scores = json.loads((tmp_path / "straighten_rope-franka.json").read_text())
    assert scores["actor"] == "franka"
    assert scores["mean"] > 0.9  # Variation 800.


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unknown_actor_is_one_line(command, capsys, monkeypatch):
    monkeypatch.setattr(view, "has_display", lambda: True)
    monkeypatch.setattr("sys.argv", ["softgym-mj", command, "straighten_rope", "--actor", "hand"])
    with pytest.raises(SystemExit) as exit_info:
        commands.main()
    assert exit_info.value.code == 1
    error = capsys.readouterr().err
    assert error.startswith("InvalidArgumentError: actor='hand'") and error.count("\n") == 1
    assert "'picker'" in error and "'franka'" in error


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unknown_grasp_is_one_line(command, capsys, monkeypatch):
    monkeypatch.setattr(view, "has_display", lambda: True)
    arguments = ["straighten_rope", "--actor", "franka", "--grasp", "glue"]
    monkeypatch.setattr("sys.argv", ["softgym-mj", command, *arguments])
    with pytest.raises(SystemExit) as exit_info:
        commands.main()
    assert exit_info.value.code == 1
    error = capsys.readouterr().err
    assert error.startswith("InvalidArgumentError: grasp='glue'") and error.count("\n") == 1
    assert "'attach'" in error and "'friction'" in error


def test_the_shell_completes_tasks():
    words = {"COMP_WORDS": "softgym-mj rollout fold", "COMP_CWORD": "2"}
    shell = {"_SOFTGYM_MJ_COMPLETE": "complete_bash", **words}
    result = CliRunner().invoke(commands.app, prog_name="softgym-mj", env=shell)
    assert result.output.split() == ["fold_cloth", "fold_crumpled_cloth"]
