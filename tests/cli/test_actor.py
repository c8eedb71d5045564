"""`--actor` and `--grasp` of the command line: the actor that `load` would build."""

import json

import pytest
from typer.testing import CliRunner

import softgym_mj
from softgym_mj.cli import commands
from softgym_mj.policies.factory import make_policy
from softgym_mj.registry import TaskRecord
from softgym_mj.viewing import window
from tests.command import output_of, status_of

COMMANDS = ("rollout", "record", "view")


def test_a_rollout_is_played_by_the_actor(monkeypatch):
    short = TaskRecord("straighten_rope", horizon=5)
    monkeypatch.setitem(softgym_mj.TASKS, short.name, short)
    command = "rollout straighten_rope --actor sawyer --grasp friction --policy random"
    line = json.loads(output_of(*command.split(), "--episodes", "1", "--seed", "3"))
    env = softgym_mj.load("straighten_rope", actor="sawyer", grasp="friction", split="evaluate")
    for _ in env.play(make_policy("random", env, 3), 800):
        pass
    assert (line["actor"], line["grasp"]) == ("sawyer", "friction")
    assert line["normalized_performance"] == env.info()["normalized_performance"]


def test_a_rollout_plays_the_variations_and_names_the_default_grasp(monkeypatch):
    short = TaskRecord("straighten_rope", horizon=1)
    monkeypatch.setitem(softgym_mj.TASKS, short.name, short)
    for actor, grasp in (("picker", None), ("ur5e", "attach")):
        command = f"rollout straighten_rope --policy zero --actor {actor} --variation 806,3-4"
        lines = [json.loads(line) for line in output_of(*command.split()).splitlines()]
        assert [line["variation"] for line in lines] == [806, 3, 4]
        assert {line["grasp"] for line in lines} == {grasp}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("options", "message", "choices"),
    [
        ("--actor hand", "actor='hand'", ("'picker'", "'franka'")),
        ("--actor franka --grasp glue", "grasp='glue'", ("'attach'", "'friction'")),
    ],
)
def test_what_is_unknown_is_one_line(command, options, message, choices, capsys, monkeypatch):
    monkeypatch.setattr(window, "check_display", lambda task: None)
    assert status_of([command, "straighten_rope", *options.split()], monkeypatch) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"InvalidArgumentError: {message}") and error.count("\n") == 1
    assert all(choice in error for choice in choices)


def test_the_shell_completes_tasks():
    words = {"COMP_WORDS": "softgym-mj rollout fold", "COMP_CWORD": "2"}
    shell = {"_SOFTGYM_MJ_COMPLETE": "complete_bash", **words}
    result = CliRunner().invoke(commands.app, prog_name="softgym-mj", env=shell)
    assert result.output.split() == ["fold_cloth", "fold_crumpled_cloth", "fold_shirt"]
