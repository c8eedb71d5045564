"""The store of start states: what is generated when, and which files are refused."""

import dataclasses
import itertools

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.native.caches import cache_folder
from softgym_mj.variations.store import VariationStore


def test_load_generates_once(store, initializer):
    first, second = store.load(7), store.load(7)
    assert initializer.calls() == [7]
    expected = initializer.points(7).astype(np.float32)
    np.testing.assert_array_equal(first, expected)
    np.testing.assert_array_equal(second, expected)
    assert first.dtype == np.float64


def test_the_first_time_it_says_what_takes_long(store, caplog):
    """One line at level INFO, no warning: there is nothing that a user must do."""
    with caplog.at_level("INFO"):
        for index in (7, 7, 8):
            store.load(index)
    (shown,) = caplog.records
    assert shown.levelname == "INFO"
    for part in ("Initial state 7", "is not cached in", str(store.folder), "softgym-mj generate"):
        assert part in shown.getMessage()


def test_load_reads_what_is_stored(store, initializer):
    store.put(7, np.full((2, 3), 0.5))
    np.testing.assert_array_equal(store.load(7), np.full((2, 3), 0.5))
    assert initializer.calls() == []


def test_cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "a"))
    assert cache_folder() == tmp_path / "a"
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", "")  # As if it were not set.
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "b"))
    assert cache_folder() == tmp_path / "b" / "softgym_mj"
    monkeypatch.delenv("SOFTGYM_MJ_CACHE")
    assert cache_folder() == tmp_path / "b" / "softgym_mj"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "c"))
    assert cache_folder() == tmp_path / "c" / ".cache" / "softgym_mj"


def test_folder_depends_on_the_parameters(initializer):
    settings = itertools.product(("fake", "other"), (1.0, 2.0))
    stores = [
        VariationStore(dataclasses.replace(initializer, name=name, scale=scale))
        for name, scale in settings
    ]
    assert len({store.folder for store in stores}) == 4
    assert all(store.folder.parent == cache_folder() for store in stores)


def test_corrupt_file_is_an_error_until_it_is_generated_again(store, initializer):
    assert store.generate_missing(range(6)) == 6
    before = store.file(4).read_bytes()
    store.file(4).write_bytes(before[:-1])
    with pytest.raises(StoreError, match=r"0004.*; delete it"):
        store.load(4)
    assert store.generate_missing(range(6)) == 1
    assert initializer.calls() == [0, 1, 2, 3, 4, 5, 4]
    assert store.file(4).read_bytes() == before


def test_generate_missing(store, initializer):
    for index in (-1, 1000, 1.5, "a"):
        with pytest.raises(InvalidArgumentError):
            store.load(index)
        with pytest.raises(InvalidArgumentError):
            store.generate_missing([0, index])
    assert initializer.calls() == []
    indices = [3, 0, 999, 17, 4]
    store.generate_missing([0, 17])
    seen = []
    assert store.generate_missing(indices, None, seen.append) == 3
    assert sorted(seen) == sorted(indices)
    assert sorted(initializer.calls()) == sorted(indices)
    for index in indices:
        expected = initializer.points(index).astype(np.float32)
        np.testing.assert_array_equal(store.load(index), expected)
