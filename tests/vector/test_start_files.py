"""Files of initial states: what they give back, and what is not kept in them."""

import os
import pickle
import shutil
import time

import numpy as np
import pytest

import softgym_mj
from softgym_mj.tasks import StraightenRope
from softgym_mj.vector.batch import initial_states, start_files
from tests.vector.same import same

VARIATIONS = [3, 4, 5, 6]


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path))
    monkeypatch.setattr(initial_states, "MANY", 2)
    monkeypatch.setattr(initial_states, "num_cores", lambda: 1)
    return tmp_path / "initial_states"


def _first(task, **settings):
    settings = {"observation": "full", **settings}
    envs = softgym_mj.make_vec(task, 4, device="host", fidelity="fast", **settings)
    found = envs.reset(options={"variation": VARIATIONS})
    envs.close()
    return found


@pytest.mark.parametrize("task", ["straighten_rope", "drop_cloth", "transport_water"])
def test_a_second_start_simulates_nothing_and_is_the_same(task, folder, monkeypatch):
    first = _first(task)
    assert len([*folder.glob("*/*.value")]) == len(VARIATIONS)
    monkeypatch.setattr(initial_states, "read", lambda *_: pytest.fail("a state was read"))
    assert same(_first(task), first)


def test_a_cache_that_cannot_be_written_is_one_warning(folder, monkeypatch):
    monkeypatch.setattr(initial_states, "_SHARE", 1)  # Each share fails.
    first = _first("straighten_rope")
    shutil.rmtree(folder)
    folder.touch()
    with pytest.warns(UserWarning, match="cannot be written.* Set SOFTGYM_MJ_CACHE") as warned:
        assert same(_first("straighten_rope"), first)
    assert len(warned) == 1


def test_a_full_cache_is_one_warning(disk, folder, monkeypatch):
    first = _first("straighten_rope")
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(disk.path))
    disk.fill(left=16 << 10)  # Room for the specification.
    with pytest.warns(UserWarning, match="No space left.* Set SOFTGYM_MJ_CACHE") as warned:
        assert same(_first("straighten_rope"), first)
    assert len(warned) == 1


def test_damaged_files_are_replaced(folder):
    first = _first("straighten_rope")
    file, other, *_ = sorted(folder.glob("*/*.value"))
    whole = file.read_bytes(), other.read_bytes()
    file.write_bytes(whole[0][:-1])
    other.write_bytes(b"")
    assert same(_first("straighten_rope"), first)
    assert (file.read_bytes(), other.read_bytes()) == whole


def test_states_that_are_too_large_are_not_kept(folder, monkeypatch):
    monkeypatch.setattr(start_files, "_LARGEST", 1e3)
    _first("straighten_rope")
    assert not [*folder.glob("*/*.value")]


def test_scenes_of_images_are_not_kept(folder):
    seen, _ = _first("straighten_rope", observation="rgb", image_size=(32, 32))
    assert seen.shape == (4, 32, 32, 3) and not folder.exists()


def test_old_folders_of_other_versions_are_deleted(folder):
    old, young = (folder / f"{digit * 12}-0123456789ab" for digit in "01")
    for each in (old, young):
        each.mkdir(parents=True)
    week = 7 * 24 * 3600
    os.utime(old, (time.time() - week - 60,) * 2)
    os.utime(young, (time.time() - week + 60,) * 2)
    _first("straighten_rope")
    left = {file.name[:12] for file in folder.iterdir()}
    assert left == {young.name[:12], start_files._version()[:12]}


def test_code_of_others_is_not_kept(folder):
    class Mine(StraightenRope):
        pass

    own = pickle.dumps(StraightenRope)
    assert start_files.start_files(own, StraightenRope) is not None
    assert start_files.start_files(own, Mine) is None
    assert start_files.start_files(pickle.dumps(same), StraightenRope) is None


def test_nested_arrays_come_back(folder):
    files = start_files.StartFiles(b"arguments")
    values = {"a": {"b": np.arange(6).reshape(2, 3), "c": {"d": 2.5}}, "e": np.zeros(0), "f": {}}
    files.put(7, values)
    found = files.get(7)
    assert found["a"]["b"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert found["a"]["c"]["d"] == 2.5 and found["e"].shape == (0,) and found["f"] == {}
