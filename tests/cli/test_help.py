"""Help of commands is complete."""

import importlib.metadata

import pytest
import typer
from typer.testing import CliRunner

from softgym_mj.cli.commands import app


def _commands(command, path=()):
    inner = getattr(command, "commands", None)
    if inner is None:
        yield path, command
        return
    for name, each in inner.items():
        yield from _commands(each, (*path, name))


COMMANDS = dict(_commands(typer.main.get_command(app)))


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_units_are_shown(path):
    target = [
        word for o in COMMANDS[path].params for word in (getattr(o, "help", "") or "").split()
    ]
    shown = CliRunner().invoke(app, [*path, "--help"], env={"COLUMNS": "200"}).stdout
    assert [word for word in target if word.startswith("[") and word not in shown] == []


def test_the_version_is_the_package_s():
    shown = CliRunner().invoke(app, ["--version"])
    assert shown.exit_code == 0
    assert shown.stdout.startswith(f"softgym-mj {importlib.metadata.version('softgym_mj')} (")


def test_every_command_is_in_a_panel():
    shown = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "120"}).stdout
    assert "─ Commands ─" not in shown
    assert shown.index(" demo ") < min(
        shown.index(f" {path[0]} ") for path in COMMANDS if path != ("demo",)
    )
