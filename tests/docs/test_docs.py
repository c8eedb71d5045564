"""Runs the Python and the commands that README and docs show."""

import copy
import dataclasses
import inspect
import pathlib
import re
import shlex

import gymnasium
import imageio.v3 as imageio
import numpy as np
import pytest

import softgym_mj
from softgym_mj import compat, registry
from softgym_mj.cli import playing
from softgym_mj.entities import View
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.rendering.look import FAST, LOOKS
from tests.command import invoked, output_of
from tools import architecture, tables

ROOT = pathlib.Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
QUICKSTART = (ROOT / "docs" / "quickstart.md").read_text()
MIGRATION = (ROOT / "docs" / "migration.md").read_text()
DOMAIN = (ROOT / "docs" / "domain.md").read_text()
ARGUMENTS = (ROOT / "docs" / "arguments.md").read_text()
PLUS = (ROOT / "docs" / "softgym_plus.md").read_text()
CUSTOM_TASKS = (ROOT / "docs" / "custom_tasks.md").read_text()
ROBOTS = (ROOT / "docs" / "robots.md").read_text()
REALITY = (ROOT / "docs" / "reality.md").read_text()
EVALUATION = (ROOT / "docs" / "evaluation.md").read_text()
POLICIES = (ROOT / "docs" / "policies.md").read_text()
CLOTH = (ROOT / "softgym_mj" / "cloth" / "plugin" / "README.md").read_text()


def blocks(language, text=README):
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


@pytest.mark.parametrize(
    "code",
    [
        code
        for page in (
            README,
            QUICKSTART,
            MIGRATION,
            DOMAIN,
            ARGUMENTS,
            CUSTOM_TASKS,
            ROBOTS,
            REALITY,
            EVALUATION,
            POLICIES,
        )
        for code in blocks("python", page)
    ],
    ids=lambda code: code.splitlines()[0],
)
def test_python_blocks_run(code, monkeypatch):
    # SoftGym's scripts change its table in place.
    monkeypatch.setattr(compat, "env_arg_dict", copy.deepcopy(compat.env_arg_dict))
    shipped = set(registry.TASKS)
    exec(compile(code, "README.md", "exec"), {})
    for name in set(registry.TASKS) - shipped:  # Other tests go through all tasks.
        gymnasium.registry.pop(registry.TASKS.pop(name).gymnasium_id)
    registry.list_in_suite()


def test_the_first_block_prints_what_it_says_every_time(capsys):
    for _ in range(2):
        exec(compile(blocks("python")[0], "README.md", "exec"), {})
    (printed,) = {*capsys.readouterr().out.splitlines()}
    assert f"  # {printed}\n" in blocks("python")[0]


def test_every_field_of_a_view_is_explained():
    section = CUSTOM_TASKS.split("`view` of a task is")[1].split("\n\n")[1]
    listed = {
        name
        for row in section.splitlines()
        for name in re.findall(r"`(\w+)`", row[: row.find("|", 1)])
    }
    assert listed == {field.name for field in dataclasses.fields(View)}


def test_the_example_of_the_cloth_plugin_runs(tmp_path, monkeypatch, capsys):
    (model,) = blocks("xml", CLOTH)
    code, tube = blocks("python", CLOTH)
    (tmp_path / "scene.xml").write_text(model)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "cloth", "exec"), {})
    assert {line.split()[0] for line in capsys.readouterr().out.splitlines()} <= {"rod", "box"}
    names = {"points": np.eye(3)}
    exec(compile(tube, "tube", "exec"), names)
    assert len(names["vertices"]) == len(names["texture"]) > names["faces"].max()


def test_the_migration_page_lists_every_name():
    for name, record in registry.TASKS.items():
        old = record.resolve().softgym_name
        row = rf"^\| `{old}` \| \w+ \| `{name}` \|$"
        assert old is None or re.search(row, MIGRATION, re.MULTILINE)


def test_links_lead_to_files():
    for target in re.findall(r"\]\((?!http)([^)#]+)(?:#[^)]*)?\)", README):
        assert (ROOT / target).exists(), target


def shown_commands():
    lines = "".join(blocks("sh", QUICKSTART)).replace("\\\n", "").splitlines()
    return [line.split("#")[0].strip() for line in lines if line.startswith("softgym-mj")]


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory):
    """Where the commands run, one after the other."""
    return tmp_path_factory.mktemp("commands")


LONG = "softgym-mj photo"  # Rendering takes seconds.


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=pytest.mark.long if command.startswith(LONG) else ())
        for command in shown_commands()
    ],
)
def test_commands_run(command, monkeypatch, folder):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    # Large frames for people take a tenth of a second each.
    monkeypatch.setattr(playing, "VIDEO_SIZE", 96)
    monkeypatch.setitem(LOOKS, "paper", dataclasses.replace(FAST, name="paper"))
    for needed in shlex.split(command)[2:] if " plot " in command else []:
        if needed.startswith("runs/") and not (folder / needed).exists():
            (maker,) = [other for other in shown_commands() if other.endswith(f"--out {needed}")]
            invoked(*shlex.split(maker)[1:])
    result = invoked(*shlex.split(command)[1:])
    if command.startswith("softgym-mj view"):
        assert type(result.exception).__name__ == "UnavailableError"
        assert "softgym-mj rollout" in str(result.exception)
        return
    assert result.exit_code == 0, result.output
    if " list" in command:
        assert all(name[:10] in result.output for name in registry.TASKS)
    if " rollout " in command:
        assert result.output.count('"normalized_performance"') == 2


def test_make_targets_exist_and_ci_runs_the_test_command():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make ([\w-]+)", README, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)
    assert "make test\n" in (ROOT / ".ci" / "run").read_text()


def test_tables_list_every_task_and_argument():
    assert "](docs/videos/tasks.webp)" in README
    for name, record in registry.TASKS.items():
        is_softgym = record.suite == registry.DOMAIN
        assert (f"[`{name}`](docs/tasks/{name}.md)" in README) == is_softgym
        assert (f"[`{name}`](tasks/{name}.md)" in PLUS) != is_softgym
        assert f"](../videos/{name}.webp)" in (ROOT / "docs/tasks" / f"{name}.md").read_text()
        for argument in record.arguments:
            assert f"`{argument}`" in ARGUMENTS
    for parameter in inspect.signature(SoftGymEnv).parameters.values():
        if parameter.kind is not parameter.VAR_KEYWORD and parameter.name != "task":
            (row,) = re.findall(rf"^\| `{parameter.name}` \|.*\| (.*) \|$", ARGUMENTS, re.MULTILINE)
            if parameter.default is not None:  # Often the task's.
                assert row.strip("`").replace('"', "") == str(parameter.default)


def test_demo_writes_videos_that_move(tmp_path, monkeypatch):
    one = {"straighten_rope": registry.TASKS["straighten_rope"]}
    monkeypatch.setattr(softgym_mj, "TASKS", one)
    arguments = ["demo", "--out", str(tmp_path), "--size", "96", "--look", "fast"]
    output_of(*arguments)
    frames = imageio.imread(tmp_path / "straighten_rope.mp4")
    assert frames.shape == (76, 96, 96, 3)  # The start and 75 env steps.
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 100
    picture = imageio.imread(tmp_path / "straighten_rope.png")
    assert picture.shape == (96, 96, 3)


@pytest.mark.long
def test_the_scores_are_those_of_the_files():
    for path, text in tables.pages().items():
        assert path.read_text() == text


def test_a_task_without_measurements_is_listed(monkeypatch):
    record = registry.TaskRecord("lay_rope", registry.TASKS["straighten_rope"].resolve())
    monkeypatch.setitem(registry.TASKS, "lay_rope", record)
    (row,) = re.findall(r".*docs/tasks/lay_rope.md.*", tables.overview(tables.measured("experts")))
    assert row.count("not yet measured") == 2 and "not yet played" in row


def test_the_picture_of_the_folders_is_theirs():
    assert architecture.FILE.read_text() == architecture.svg()
    page = (ROOT / "docs" / "architecture.md").read_text()
    listed = re.findall(r"^\*\*`(\w+)`\*\*", page, re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert set(listed) == {name for layer in architecture.LAYERS for name in layer} - {"__init__"}
