"""Packs of start states: byte comparison, damage, and what is shipped."""

import dataclasses
import pathlib
import time

import numpy as np
import pytest

from softgym_mj import assets
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.variations import indices, packs
from softgym_mj.variations.store import VariationStore
from tools import packs as written
from tools.packs import pack, write

SPECIFICATION = '{"initializer": "test"}'


def some_states() -> list[np.ndarray]:
    random = np.random.default_rng(0)
    return [random.normal(size=(count, 3)).astype(np.float32) for count in (5, 1, 41)]


def test_write_and_read(tmp_path):
    file = tmp_path / "deep" / "folder" / "states.npz"
    states = some_states()
    write(file, states, SPECIFICATION)
    found = packs.read_pack(file, SPECIFICATION)
    assert len(found) == len(states)
    for state, expected in zip(found, states, strict=True):
        assert state.dtype == np.float64
        np.testing.assert_array_equal(state, expected)
    assert [path.name for path in file.parent.iterdir()] == ["states.npz"]


def test_same_input_gives_the_same_bytes(file, tmp_path, monkeypatch):
    # Zip entries can hold a time of day; another day must give the same file.
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2_000_000_000))
    monkeypatch.setattr(time, "time", lambda: 2e9)
    write(tmp_path / "later", some_states(), SPECIFICATION)
    assert file.read_bytes() == (tmp_path / "later").read_bytes()


@pytest.fixture(name="file")
def _file(tmp_path) -> pathlib.Path:
    file = tmp_path / "states.npz"
    write(file, some_states(), SPECIFICATION)
    return file


def test_wrong_specification(file):
    assert packs.read_pack(file, SPECIFICATION.replace("test", "other")) is None


# ---------------------------------------------------------------- the shipped set


@pytest.fixture(name="packed")
def _packed(store, initializer, tmp_path, monkeypatch) -> pathlib.Path:
    """All of six variations packed into the place of the shipped set; the cache is empty."""
    for module in (indices, written):
        monkeypatch.setattr(module, "NUM_VARIATIONS", 6)
    store.generate_missing(range(6))
    file = tmp_path / "assets" / f"{initializer.name}.npz"
    pack(store, file)
    for index in range(6):
        store.file(index).unlink()
    pathlib.Path(initializer.log).unlink()
    monkeypatch.setattr(assets, "path", lambda *parts: str(tmp_path / "assets" / parts[-1]))
    packs.shipped.cache_clear()
    yield file
    packs.shipped.cache_clear()


def test_pack_holds_all_variations(packed, initializer):
    specification = str(np.load(packed)["specification"])
    states = packs.read_pack(packed, specification)
    assert len(states) == 6
    for index, state in enumerate(states):
        np.testing.assert_array_equal(state, initializer.points(index).astype(np.float32))


def test_pack_needs_all_variations(store, tmp_path, monkeypatch):
    monkeypatch.setattr(written, "NUM_VARIATIONS", 4)
    store.generate_missing((0, 1, 3))
    with pytest.raises(StoreError, match=r"0002\.value is missing"):
        pack(store, tmp_path / "packed.npz")
    assert not (tmp_path / "packed.npz").exists()


@pytest.mark.usefixtures("packed")
def test_shipped_states_are_used_first(store, initializer):
    store.load(0)[:] = 0.0  # It belongs to the caller.
    for index in (5, 0):
        expected = initializer.points(index).astype(np.float32)
        np.testing.assert_array_equal(store.load(index), expected)
    assert initializer.calls() == []
    with pytest.raises(InvalidArgumentError):
        store.load(6)


@pytest.mark.usefixtures("packed")
def test_shipped_states_of_other_parameters_are_ignored(initializer):
    other = VariationStore(dataclasses.replace(initializer, scale=3.0))
    np.testing.assert_array_equal(other.load(1), (3.0 * initializer.points(1)).astype(np.float32))
    assert initializer.calls() == [1]
