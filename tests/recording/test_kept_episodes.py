"""Recordings that are interrupted, killed and run again."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import warnings

import minari
import numpy as np
import pytest
from minari.dataset._storages.hdf5_storage import HDF5Storage

from softgym_mj.exceptions import StoreError
from softgym_mj.parallel.executors import SerialExecutor
from softgym_mj.recording import datasets, record, running
from tests.command import status_of

TASK, SHORT = "straighten_rope", {"horizon": 3}
# Random actions from a generator that outlives episodes, and an end by SIGKILL.
POLICY = """
import os
import pathlib
import signal

import numpy as np


def make(env):
    random = np.random.default_rng(0)

    def act(timestep):
        fuse = pathlib.Path("fuse")
        if env.task.variation == 2 and env.step_count == 1 and fuse.exists():
            fuse.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        return random.uniform(-1, 1, 8)

    return act
"""


@pytest.fixture(autouse=True)
def _own_folders(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    monkeypatch.chdir(tmp_path)


@pytest.fixture(name="played")
def _played(monkeypatch):
    """The variations that are played, not read."""
    variations = []

    def played(*how):
        variations.append(how[-1])
        return original(*how)

    original = running.played
    monkeypatch.setattr(running, "played", played)
    return variations


def interrupt_after(number):
    """For `on_episode`: Ctrl-C after so many of them."""
    seen = []

    def on_episode(info):
        seen.append(info)
        if len(seen) == number:
            raise KeyboardInterrupt

    return on_episode


def local_datasets():
    """Ids of the datasets that Minari finds, without a complaint about any."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return list(minari.list_local_datasets())


def metadata(dataset):
    """Of the dataset but for its id, and of its episodes."""
    episodes = dataset.storage.get_episode_metadata(range(len(dataset)))
    return {**dataset.storage.metadata, "dataset_id": None}, list(episodes)


def assert_same(one, other):
    """Two datasets have the same bits, and metadata but for the id."""
    for first, second in zip(one.iterate_episodes(), other.iterate_episodes(), strict=True):
        for part in ("observations", "actions", "rewards", "terminations", "truncations", "infos"):
            np.testing.assert_equal(getattr(first, part), getattr(second, part))
    assert metadata(one) == metadata(other)


def test_who_stops_while_the_dataset_is_written_plays_nothing_again(played, monkeypatch):
    write, stop = HDF5Storage.update_episodes, interrupt_after(2)
    with monkeypatch.context() as patched:
        patched.setattr(HDF5Storage, "update_episodes", lambda *args: (write(*args), stop(args)))
        with pytest.raises(KeyboardInterrupt):
            record(TASK, range(3), "random", dataset="rope/parts-v0", **SHORT)
    assert local_datasets() == []
    parts = record(TASK, range(3), "random", dataset="rope/parts-v0", **SHORT)
    assert played == [0, 1, 2] and parts.total_episodes == 3
    assert_same(parts, record(TASK, range(3), "random", dataset="rope/whole-v0", **SHORT))


def test_who_stops_once_the_dataset_is_in_its_place_has_it(played, monkeypatch):
    remove = shutil.rmtree

    def stop(folder, **settings):
        if folder.name == datasets.EPISODES:
            (folder / "0001.value").unlink()  # Some are gone already.
            raise KeyboardInterrupt
        remove(folder, **settings)

    with monkeypatch.context() as patched:
        patched.setattr(shutil, "rmtree", stop)
        with pytest.raises(KeyboardInterrupt):
            record(TASK, range(3), "random", dataset="rope/parts-v0", **SHORT)
    assert local_datasets() == ["rope/parts-v0"]
    parts = record(TASK, range(3), "random", dataset="rope/parts-v0", **SHORT)
    assert played == [0, 1, 2, 1]
    assert_same(parts, record(TASK, range(3), "random", dataset="rope/whole-v0", **SHORT))
    assert not list(pathlib.Path("datasets").rglob(".*"))
    with pytest.raises(
        StoreError, match="dataset='rope/parts-v0' exists with different variations"
    ):
        record(TASK, range(4), "random", dataset="rope/parts-v0", **SHORT)


def test_a_killed_command_goes_on(played, monkeypatch):
    pathlib.Path("own_fuse.py").write_text(POLICY)
    pathlib.Path("fuse").touch()
    settings = {"image_size": (16, 16), **SHORT}
    arguments = ["record", TASK, "--policy", "own_fuse:make", "--episodes", "4"]
    arguments += ["--task-settings", json.dumps(settings), "--dataset", "rope/parts-v0"]
    arguments += ["--observation", "reduced,rgb"]
    command = [sys.executable, "-m", "softgym_mj.cli.commands", *arguments]
    killed = subprocess.run(command, capture_output=True, check=False)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert local_datasets() == []
    monkeypatch.syspath_prepend(os.getcwd())
    assert status_of(arguments, monkeypatch) == 0 and played == [2, 3]
    assert not list(pathlib.Path("datasets").glob(".*"))  # Nothing is left over.
    settings["observation"] = ["reduced", "rgb"]
    whole = record(TASK, range(4), "own_fuse:make", dataset="rope/whole-v0", **settings)
    assert_same(minari.load_dataset("rope/parts-v0"), whole)


def test_the_same_recording_is_found(played):
    first = record(TASK, range(2), "random", dataset="rope-v0", **SHORT)
    assert_same(first, record(TASK, range(2), "random", dataset="rope-v0", jobs=2, **SHORT))
    assert played == [0, 1]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"horizon": 4}, "settings"),
        ({"seed": 1}, "seed"),
        ({"noise": 0.1}, "noise"),
        ({"policy": "random"}, "policy"),
        ({"variations": (1, 0)}, "variations"),
        ({"successful_only": True}, "successful_only"),
        ({"task": "rope_configuration"}, "task"),
    ],
)
def test_another_recording_is_not_taken_for_the_same(changes, named, played):
    usual = {"task": TASK, "variations": (0, 1), "policy": "zero", "dataset": "rope-v0", **SHORT}
    record(**usual)
    message = f"'rope-v0' exists with different {named}; choose another .*delete .*rope-v0$"
    with pytest.raises(StoreError, match=message):
        record(**{**usual, **changes})
    assert played == [0, 1] and local_datasets() == ["rope-v0"]


def test_another_expert_is_not_taken_for_the_same(played, monkeypatch):
    record(TASK, (0,), dataset="rope-v0", **SHORT)
    monkeypatch.setattr(running, "sources_sha256", lambda task: f"other {task.name}")
    with pytest.raises(StoreError, match="'rope-v0' exists with different policy_sha256"):
        record(TASK, (0,), dataset="rope-v0", **SHORT)
    assert played == [0]


def test_a_dataset_of_others_is_not_taken_for_ours(played):
    dataset = record(TASK, (0,), "random", dataset="rope-v0", **SHORT)
    (dataset.storage.data_path.parent / "recording.json").unlink()
    with pytest.raises(StoreError, match="'rope-v0' exists with different task, policy"):
        record(TASK, (0,), "random", dataset="rope-v0", **SHORT)
    assert played == [0]


@pytest.mark.parametrize(
    ("policy", "settings", "named"),
    [("zero", SHORT, "policy"), ("random", {"horizon": 4}, "settings")],
)
def test_recordings_are_not_mixed(policy, settings, named, played):
    with pytest.raises(KeyboardInterrupt):
        record(TASK, range(2), "random", dataset="rope-v0", on_episode=interrupt_after(1), **SHORT)
    with pytest.raises(StoreError, match=rf"\.rope-v0\.unfinished holds .* another {named};"):
        record(TASK, range(2), policy, dataset="rope-v0", **settings)
    assert played == [0]


def test_ctrl_c_says_how_to_go_on(capsys, monkeypatch):
    played, stop = running.played, interrupt_after(2)
    monkeypatch.setattr(running, "played", lambda *how: (stop(how), played(*how))[1])
    assert status_of(["record", TASK, "--policy", "zero"], monkeypatch) == 130
    assert "interrupted; 1 episodes of straighten_rope are stored" in capsys.readouterr().err


def test_ctrl_c_names_what_is_stored(capsys, monkeypatch):
    """Processes finish in any order."""

    class Backward(SerialExecutor):
        def results(self, function, calls):
            for index in (3, 1):
                yield index, function(*calls[index])
            raise KeyboardInterrupt

    monkeypatch.setattr(running, "make_executor", lambda jobs: Backward())
    command = ["record", TASK, "--policy", "zero", "--task-settings", json.dumps(SHORT)]
    assert status_of([*command, "--variations", "4-8"], monkeypatch) == 130
    message = "2 episodes of straighten_rope are stored; --variations 5,7 makes"
    assert message in capsys.readouterr().err
