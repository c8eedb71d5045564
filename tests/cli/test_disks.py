"""Commands whose folders are full, read-only or files: one line that names the path, status 1."""

import pytest

from softgym_mj.cli import playing
from tests.command import status_of

SHORT = '{"horizon": 3}'
PLANNER = "--policy icem --horizon 2 --budget 40 --iterations 2"
COMMANDS = {
    "generate": ["generate", "straighten_rope", "--fidelity", "fast", "--num", "1"],
    "evaluate": ["evaluate", "straighten_rope", "--episodes", "3", "--task-settings", SHORT,
                 "--out"],
    "planner": ["evaluate", "straighten_rope", "--episodes", "1", "--task-settings", SHORT,
                *PLANNER.split(), "--out"],
    "rollout": ["rollout", "straighten_rope", "--policy", "zero", "--episodes", "1",
                "--look", "fast", "--video"],
    "record": ["record", "straighten_rope", "--episodes", "2", "--task-settings", SHORT],
}  # fmt: skip


SLOW = pytest.mark.slow
STAGES = (0, *(2**i << 10 for i in range(2, 13)))  # Space that is left [bytes].


def run(name, folder, monkeypatch, capsys):
    """Status and last line of a command that writes into a folder."""
    arguments = COMMANDS[name] + [str(folder)] * (COMMANDS[name][-1].startswith("--"))
    monkeypatch.setattr(playing, "VIDEO_SIZE", 64)
    for variable in ("SOFTGYM_MJ_CACHE", "MINARI_DATASETS_PATH"):
        monkeypatch.setenv(variable, str(folder))
    status, error = status_of(arguments, monkeypatch), capsys.readouterr().err
    assert "Traceback" not in error
    return status, error


def assert_named(outcome, path):
    status, error = outcome
    assert status == 1
    assert error.startswith("StoreError: ") and error.count("\n") == 1
    assert str(path) in error and "cannot be written" in error


@pytest.mark.parametrize("name", COMMANDS)
def test_read_only(name, disk, monkeypatch, capsys):
    disk.set_writable(False)
    assert_named(run(name, disk.path / "new", monkeypatch, capsys), disk.path / "new")
    disk.set_writable(True)
    assert run(name, disk.path / "new", monkeypatch, capsys)[0] == 0


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW if name == "rollout" else ()) for name in COMMANDS]
)
def test_full(name, disk, monkeypatch, capsys):
    """The space that is left grows until it is enough; then nothing is left over."""
    folder, stages = disk.path / "new", 0
    for left in STAGES:
        disk.fill(left)
        status, error = run(name, folder, monkeypatch, capsys)
        if status == 0:
            break
        assert_named((status, error), folder)
        stages += 1
        assert not list(folder.rglob("*.partial"))
    assert status == 0 and stages >= 1
    assert not list(disk.path.glob(".*.unfinished"))
    if name in ("evaluate", "planner"):  # The same as on a large disk.
        other = disk.path.parent / "other"
        assert run(name, other, monkeypatch, capsys)[0] == 0
        assert (folder / "result.json").read_bytes() == (other / "result.json").read_bytes()


@pytest.mark.parametrize("name", COMMANDS)
def test_a_file_or_no_place_at_all(name, tmp_path, monkeypatch, capsys):
    file = tmp_path / "file"
    file.write_text("mine")
    for folder in (file, file / "a", "/proc/softgym"):
        assert_named(run(name, folder, monkeypatch, capsys), folder)
    assert file.read_text() == "mine"
