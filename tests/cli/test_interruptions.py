"""Commands that are interrupted or killed: messages, files left behind, continuation."""

import ctypes
import os
import pathlib
import random
import select
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import minari
import pytest
from typer.testing import CliRunner

import softgym_mj
from softgym_mj.cli.commands import app
from tests.recording.test_kept_episodes import assert_same
from tests.viewing.chromium import wait_until

ROOT = pathlib.Path(__file__).parents[2]
PLANNER = '--policy icem --horizon 2 --budget 40 --iterations 2 --task-settings {"horizon":8}'
COMMANDS = {
    "generate": "generate straighten_rope --fidelity fast --num 400",
    "generate by two": "generate straighten_rope --fidelity fast --num 400 --jobs 2",
    "evaluate": "evaluate straighten_rope --policy random --episodes 200",
    "evaluate by two": "evaluate straighten_rope --policy random --episodes 200 --jobs 2",
    "plan": f"evaluate straighten_rope {PLANNER} --episodes 100",
    "rollout": "rollout straighten_rope --policy zero --episodes 100",
    "film": "rollout straighten_rope --policy zero --episodes 100 --video videos",
    "demo": "demo --size 64",
    "record": "record straighten_rope --policy random --episodes 400 --dataset rope/x-v0",
}
# As the console script does: CPython ends `python -m` by the signal if it came within exec("").
MAIN = "from softgym_mj_command import main; main()"
LONG = ("film", "demo", "rollout", "generate", "generate by two", "evaluate", "plan")


def start(command, folder):
    """A real command line, in a process group of its own as a terminal has it."""
    own = {"SOFTGYM_MJ_CACHE": str(folder / "cache"), "MINARI_DATASETS_PATH": str(folder / "sets")}
    return subprocess.Popen(
        [sys.executable, "-c", MAIN, *command.split()],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{ROOT}:{os.environ.get('PYTHONPATH', '')}", **own},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def files(folder):
    """Contents of all files below a folder by path."""
    result = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in result}


def wrote(folder):
    """Whether there is a file below a folder; it may vanish at any time."""
    return any(path.is_file() for path in folder.rglob("*"))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long if name in LONG else ()) for name in COMMANDS],
)
@pytest.mark.parametrize("pause", [0.0, pytest.param(2.0, marks=pytest.mark.slow)])
def test_ctrl_c_ends_with_one_line(name, pause, tmp_path):
    with start(COMMANDS[name], tmp_path) as process:
        try:
            wait_until(lambda: select.select([process.stdout], [], [], 0)[0] or wrote(tmp_path), 60)
            time.sleep(pause)
        finally:
            os.killpg(process.pid, signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    # Besides, dm_control may say that it cannot delete half an OpenGL context.
    assert sum(line.startswith("interrupted") for line in error.splitlines()) == 1, error
    assert "KeyboardInterrupt" not in error and "EOFError" not in error
    # Workers end at once, perhaps while they write to the cache.
    left = (path for path in files(tmp_path) if not path.startswith("cache"))
    assert not [path for path in left if path.endswith(".partial")]


def test_ctrl_c_that_a_library_turns_into_another_error(monkeypatch):
    class Number:
        from_param = staticmethod(lambda number: signal.raise_signal(signal.SIGINT))

    absolute = ctypes.CDLL(None).abs
    absolute.argtypes = [Number]
    monkeypatch.setattr(softgym_mj, "TASKS", SimpleNamespace(values=lambda: absolute(1)))
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        result = CliRunner().invoke(app, ["list"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert (result.exit_code, result.stderr) == (130, "interrupted\n")
    with pytest.raises(ctypes.ArgumentError, match="KeyboardInterrupt"):
        CliRunner().invoke(app, ["list"], catch_exceptions=False)


@pytest.mark.parametrize("count", [4, pytest.param(40, marks=pytest.mark.slow)])
def test_ctrl_c_in_the_first_second(count, tmp_path):
    """Python's own start, some hundredths of a second, comes before anything of this package."""
    draw = random.Random(0)
    for _ in range(count):
        command, moment = draw.choice([*COMMANDS.values()]), draw.uniform(0.15, 1.2)
        with start(command, tmp_path) as process:
            time.sleep(moment)
            os.killpg(process.pid, signal.SIGINT)
            _, error = process.communicate(timeout=60)
        assert process.returncode in (130, -signal.SIGINT), (command, moment, error)
        assert "Traceback" not in error and "KeyboardInterrupt" not in error, (command, moment)


def sweep(command, folder, moments):
    """Kills a command at moments [s] after its start until it finishes; what it leaves."""
    folder.mkdir()
    for signum, moment in [*moments, (signal.SIGKILL, 300.0)]:
        with start(command, folder) as process:
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signum)
            _, error = process.communicate(timeout=120)
        assert "Traceback" not in error
        if process.returncode == 0 or "exists; choose another id" in error:
            break  # The latter if the dataset was whole and only its process was not over.
        assert process.returncode == -signum, error
    result = {path: content for path, content in files(folder).items() if ".partial" not in path}
    assert not [path for path in result if ".unfinished" in path]
    return result


SHORT = {
    "generate": "generate straighten_rope --fidelity fast --num 12",
    "generate by two": "generate straighten_rope --fidelity fast --num 12 --jobs 2",
    "evaluate": "evaluate straighten_rope --policy random --episodes 8",
    "plan": f"evaluate straighten_rope {PLANNER} --episodes 4",
    "film": "rollout straighten_rope --policy zero --episodes 2 --video videos",
    "record": "record straighten_rope --policy random --episodes 12 --dataset rope/x-v0",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_who_is_killed_at_any_time_ends_as_who_is_not(name, tmp_path, monkeypatch):
    whole = sweep(SHORT[name], tmp_path / "whole", [])
    numbers = random.Random(name)
    moments = [
        (numbers.choice([signal.SIGKILL, signal.SIGTERM]), numbers.uniform(1.5, 7.0))
        for _ in range(6)
    ]
    parts = sweep(SHORT[name], tmp_path / "parts", moments)
    assert set(parts) == set(whole)
    if name != "record":
        assert parts == whole
        return
    sets = []
    for folder in ("whole", "parts"):  # HDF5 keeps times of day.
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / folder / "sets"))
        sets.append(minari.load_dataset("rope/x-v0"))
    assert_same(*sets)
