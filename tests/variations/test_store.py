"""The store of start states: byte comparison and damage."""

import dataclasses
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from softgym_mj.exceptions import CorruptStoreError, OutOfRangeError
from softgym_mj.jobs.executors import make_executor
from softgym_mj.variations import indices as numbering
from softgym_mj.variations import store as variations
from softgym_mj.variations.indices import generator

SPECIFICATION = '{"initializer": "test"}'


@dataclasses.dataclass(frozen=True)
class FakeInitializer:
    """Cheap random points; every call is noted as a line in the file `log`."""

    log: str
    name: str = "fake"
    scale: float = 1.0
    failing: int = -1
    delay: float = 0.0

    @property
    def parameters(self) -> dict[str, object]:
        return {"scale": self.scale}

    def points(self, index: int) -> np.ndarray:
        return self.scale * generator(self.name, index).normal(size=(3 + index % 4, 3))

    def generate(self, index: int) -> np.ndarray:
        with open(self.log, "a") as stream:
            stream.write(f"{index}\n")
        if index == self.failing:
            raise ArithmeticError(f"variation {index} fails on purpose")
        time.sleep(self.delay)
        return self.points(index)


@pytest.fixture(name="initializer")
def _initializer(tmp_path, monkeypatch) -> FakeInitializer:
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "cache"))
    return FakeInitializer(log=str(tmp_path / "log"))


@pytest.fixture(name="store")
def _store(initializer) -> variations.VariationStore:
    return variations.VariationStore(initializer)


def calls(initializer: FakeInitializer) -> list[int]:
    """The variations generated so far, in order."""
    log = pathlib.Path(initializer.log)
    return [int(line) for line in log.read_text().split()] if log.exists() else []


def contents(folder: pathlib.Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def expected_contents(initializer, indices, folder, monkeypatch) -> dict[str, bytes]:
    """The files of an undisturbed run in one process with its cache in `folder`."""
    with monkeypatch.context() as patch:
        patch.setenv("SOFTGYM_MJ_CACHE", str(folder))
        store = variations.VariationStore(initializer)
    for index in indices:
        store.generate(index)
    return contents(store.folder)


# ---------------------------------------------------------------- files


def some_states() -> list[np.ndarray]:
    random = np.random.default_rng(0)
    return [random.normal(size=(count, 3)).astype(np.float32) for count in (5, 1, 41)]


def test_write_and_read(tmp_path):
    file = tmp_path / "deep" / "folder" / "states.npz"
    states = some_states()
    variations.write_states(file, states, SPECIFICATION)
    found = variations.read_states(file, SPECIFICATION)
    assert len(found) == len(states)
    for state, expected in zip(found, states, strict=True):
        assert state.dtype == np.float64
        np.testing.assert_array_equal(state, expected)
    assert [path.name for path in file.parent.iterdir()] == ["states.npz"]


def test_float64_is_rounded_to_float32(tmp_path):
    state = np.random.default_rng(1).normal(size=(7, 3))
    variations.write_states(tmp_path / "a", [state], SPECIFICATION)
    (found,) = variations.read_states(tmp_path / "a", SPECIFICATION)
    np.testing.assert_array_equal(found, state.astype(np.float32))


def test_same_input_gives_the_same_bytes(tmp_path, monkeypatch):
    variations.write_states(tmp_path / "now", some_states(), SPECIFICATION)
    # Zip entries can hold a time of day; another day must give the same file.
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2_000_000_000))
    monkeypatch.setattr(time, "time", lambda: 2e9)
    variations.write_states(tmp_path / "later", some_states(), SPECIFICATION)
    assert (tmp_path / "now").read_bytes() == (tmp_path / "later").read_bytes()


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        variations.read_states(tmp_path / "nothing.npz", SPECIFICATION)


def assert_corrupt(file: pathlib.Path, specification: str = SPECIFICATION) -> None:
    with pytest.raises(CorruptStoreError) as error:
        variations.read_states(file, specification)
    assert str(file) in str(error.value)
    assert "softgym-mj generate" in str(error.value)


@pytest.fixture(name="file")
def _file(tmp_path) -> pathlib.Path:
    file = tmp_path / "0001.npz"
    variations.write_states(file, some_states(), SPECIFICATION)
    return file


def test_truncated_at_any_length(file):
    content = file.read_bytes()
    for length in [*range(0, len(content), 13), len(content) - 1]:
        file.write_bytes(content[:length])
        assert_corrupt(file)


@pytest.mark.parametrize(
    "content",
    [b"", b"no zip file at all", b"PK\x03\x04", b"PK\x05\x06" + bytes(18), bytes(1000)],
    ids=("empty", "text", "head", "empty zip", "zeros"),
)
def test_not_a_store(file, content):
    file.write_bytes(content)
    assert_corrupt(file)


def test_another_numpy_file(file):
    with open(file, "wb") as stream:
        np.save(stream, np.arange(12.0))
    assert_corrupt(file)


def test_npz_without_the_entries(file):
    np.savez(file, vertices=np.zeros((3, 3)))
    assert_corrupt(file)


def test_wrong_specification(file):
    assert_corrupt(file, specification=SPECIFICATION.replace("test", "other"))


@pytest.mark.parametrize("entry", ["vertices", "counts", "checksum", "specification"])
def test_one_altered_byte_of_an_entry(file, entry):
    with np.load(file) as loaded:
        entries = dict(loaded)
    # A well-formed zip file, so that only our own checksum can tell.
    altered = np.atleast_1d(entries[entry]).copy()
    altered.view(np.uint8)[4] ^= 1
    entries[entry] = altered.reshape(entries[entry].shape)
    np.savez_compressed(file, **entries)
    assert_corrupt(file)


@pytest.mark.parametrize("mask", [0x01, 0x80, 0xFF], ids=hex)
def test_any_altered_byte_of_the_file_is_seen_or_harmless(file, mask):
    content, states = file.read_bytes(), some_states()
    escaped = {}
    for position in range(len(content)):
        damaged = bytearray(content)
        damaged[position] ^= mask
        file.write_bytes(bytes(damaged))
        try:
            found = variations.read_states(file, SPECIFICATION)
        except CorruptStoreError:
            continue
        except Exception as error:  # Any other type is the failure.
            escaped[position] = repr(error)
            continue
        # Some bytes mean nothing: time stamps, attributes, the version that wrote the file.
        assert len(found) == len(states)
        assert all(map(np.array_equal, found, states)), position
    assert not escaped, f"{len(escaped)} bytes, the first: {list(escaped.items())[:3]}"


def test_interrupted_write_leaves_the_old_file(file, monkeypatch):
    before = file.read_bytes()

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            variations.write_states(file, [np.ones((2, 3))], SPECIFICATION)
        with pytest.raises(KeyboardInterrupt):
            variations.write_states(file.with_name("new"), [np.ones((2, 3))], SPECIFICATION)
    assert contents(file.parent) == {file.name: before}


# ---------------------------------------------------------------- the store


def test_load_generates_once(store, initializer):
    first, second = store.load(7), store.load(7)
    assert calls(initializer) == [7]
    expected = initializer.points(7).astype(np.float32)
    np.testing.assert_array_equal(first, expected)
    np.testing.assert_array_equal(second, expected)
    assert first.dtype == np.float64


def test_load_reads_what_is_stored(store, initializer):
    store.load(7)
    specification = variations._stored_specification(store.file(7))
    variations.write_states(store.file(7), [np.full((2, 3), 0.5)], specification)
    np.testing.assert_array_equal(store.load(7), np.full((2, 3), 0.5))
    assert calls(initializer) == [7]


def test_cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "a"))
    assert variations.cache_folder() == tmp_path / "a"
    monkeypatch.delenv("SOFTGYM_MJ_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "b"))
    assert variations.cache_folder() == tmp_path / "b" / "softgym_mj"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "c"))
    assert variations.cache_folder() == tmp_path / "c" / ".cache" / "softgym_mj"


def test_folder_depends_on_the_parameters(initializer):
    settings = itertools.product(("fake", "other"), (1.0, 2.0))
    stores = [
        variations.VariationStore(dataclasses.replace(initializer, name=name, scale=scale))
        for name, scale in settings
    ]
    assert len({store.folder for store in stores}) == 4
    assert all(store.folder.is_relative_to(variations.cache_folder()) for store in stores)


@pytest.mark.parametrize("index", [-1, 1000, 1.5, "a"])
def test_store_checks_indices(store, index):
    with pytest.raises(OutOfRangeError):
        store.load(index)


def damage(file: pathlib.Path) -> None:
    file.write_bytes(file.read_bytes()[:-40])


def test_corrupt_file_is_an_error_until_it_is_generated_again(store, initializer):
    assert store.generate_missing(range(6)) == 6
    before = contents(store.folder)
    damage(store.file(4))
    assert [store.is_stored(index) for index in range(7)] == [True] * 4 + [False, True, False]
    with pytest.raises(CorruptStoreError):
        store.load(4)
    assert store.generate_missing(range(6)) == 1
    assert calls(initializer) == [0, 1, 2, 3, 4, 5, 4]
    assert contents(store.folder) == before


def test_file_of_other_parameters_is_corrupt(store, initializer):
    other = variations.VariationStore(dataclasses.replace(initializer, scale=2.0))
    store.generate(3)
    other.generate(3)
    store.file(3).write_bytes(other.file(3).read_bytes())
    assert not store.is_stored(3)
    with pytest.raises(CorruptStoreError):
        store.load(3)


@pytest.mark.parametrize("jobs", [1, 2])
def test_files_do_not_depend_on_jobs(store, initializer, jobs, tmp_path, monkeypatch):
    indices = [3, 0, 999, 17, 4]
    expected = expected_contents(initializer, indices, tmp_path / "reference", monkeypatch)
    seen = []
    assert store.generate_missing(indices, make_executor(jobs), progress=seen.append) == 5
    assert contents(store.folder) == expected
    assert sorted(expected) == ["0000.npz", "0003.npz", "0004.npz", "0017.npz", "0999.npz"]
    assert sorted(seen) == sorted(indices)


@pytest.mark.parametrize("jobs", [1, 2])
def test_generation_resumes(store, initializer, jobs, tmp_path, monkeypatch):
    expected = expected_contents(initializer, range(6), tmp_path / "reference", monkeypatch)
    store.generate_missing((1, 2, 5))
    for index in (1, 2, 5):
        os.utime(store.file(index), ns=(10**18, 10**18))
    damage(store.file(5))
    seen = []
    count = len(calls(initializer))
    assert store.generate_missing(range(6), make_executor(jobs), progress=seen.append) == 4
    assert sorted(calls(initializer)[count:]) == [0, 3, 4, 5]
    assert sorted(seen) == list(range(6))
    assert contents(store.folder) == expected
    assert store.file(1).stat().st_mtime_ns == 10**18
    assert store.file(2).stat().st_mtime_ns == 10**18
    assert store.generate_missing(range(6), make_executor(jobs)) == 0


@pytest.mark.parametrize("jobs", [0, -1])
def test_bad_jobs(store, initializer, jobs):
    with pytest.raises(OutOfRangeError, match=f"jobs={jobs} .*1 or more"):
        store.generate_missing(range(3), make_executor(jobs))
    assert calls(initializer) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_failure_leaves_what_is_finished(initializer, jobs, tmp_path, monkeypatch):
    expected = expected_contents(initializer, range(5), tmp_path / "reference", monkeypatch)
    count = len(calls(initializer))
    failing = variations.VariationStore(dataclasses.replace(initializer, failing=3, delay=0.2))
    with pytest.raises(ArithmeticError, match="variation 3 fails"):
        failing.generate_missing(range(5), make_executor(jobs))
    found = contents(failing.folder)
    assert found.items() <= expected.items()
    # The error comes when nothing runs any more: what was started, other processes too, is there.
    started = set(calls(initializer)[count:])
    assert sorted(found) == [f"{index:04d}.npz" for index in sorted(started - {3})]
    assert started == {0, 1, 2, 3} if jobs == 1 else started >= {0, 1, 3}
    store = variations.VariationStore(initializer)  # The cause is removed.
    store.generate_missing(range(5), make_executor(jobs))
    assert contents(store.folder) == expected


# ---------------------------------------------------------------- killed and resumed

KILLED_COUNT = 12

# Generates slowly; with a second argument it kills itself in the write of that many files.
SCRIPT = f"""
import os, signal, sys
from tests.variations import test_store as module
from softgym_mj.variations import store as variations

if len(sys.argv) > 2:
    replace, left = os.replace, [int(sys.argv[2])]
    def dying_replace(*files):
        left[0] -= 1
        if not left[0]:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(*files)
    os.replace = dying_replace
store = variations.VariationStore(module.FakeInitializer(log=sys.argv[1], delay=0.05))
store.generate_missing(range({KILLED_COUNT}), progress=lambda index: print(index, flush=True))
"""


def start_generation(*arguments: str) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *arguments],
        cwd=pathlib.Path(__file__).parents[2],  # Where it finds the tests.
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("moment", ["between", "in a write"])
def test_kill_and_resume(store, initializer, moment, tmp_path, monkeypatch):
    indices = range(KILLED_COUNT)
    expected = expected_contents(initializer, indices, tmp_path / "reference", monkeypatch)
    if moment == "between":
        with start_generation(initializer.log) as process:
            for line in process.stdout:
                if int(line) == 3:
                    process.kill()
                    break
    else:
        with start_generation(initializer.log, "5") as process:
            process.communicate()
    assert process.returncode == -signal.SIGKILL
    finished = {file.name: file.read_bytes() for file in store.folder.glob("*.npz")}
    assert 4 <= len(finished) < KILLED_COUNT
    assert finished.items() <= expected.items()

    with start_generation(initializer.log) as process:
        seen = sorted(map(int, process.stdout))
    assert process.returncode == 0
    assert seen == list(indices)
    resumed = {file.name: file.read_bytes() for file in store.folder.glob("*.npz")}
    assert resumed == expected


# ---------------------------------------------------------------- the shipped set


@pytest.fixture(name="packed")
def _packed(store, initializer, tmp_path, monkeypatch) -> pathlib.Path:
    """All of six variations packed into the place of the shipped set; the cache is empty."""
    for module in (numbering, variations):
        monkeypatch.setattr(module, "NUM_VARIATIONS", 6)
    store.generate_missing(range(6))
    file = tmp_path / "assets" / f"{initializer.name}.npz"
    store.pack(file)
    for index in range(6):
        store.file(index).unlink()
    pathlib.Path(initializer.log).unlink()
    monkeypatch.setattr(
        variations.assets, "path", lambda *parts: str(tmp_path / "assets" / parts[-1])
    )
    variations._shipped_states.cache_clear()
    yield file
    variations._shipped_states.cache_clear()


def test_pack_holds_all_variations(packed, initializer):
    specification = variations._stored_specification(packed)
    states = variations.read_states(packed, specification)
    assert len(states) == 6
    for index, state in enumerate(states):
        np.testing.assert_array_equal(state, initializer.points(index).astype(np.float32))


def test_pack_needs_all_variations(store, tmp_path, monkeypatch):
    monkeypatch.setattr(variations, "NUM_VARIATIONS", 4)
    store.generate_missing((0, 1, 3))
    with pytest.raises(FileNotFoundError, match=r"0002\.npz"):
        store.pack(tmp_path / "packed.npz")
    assert not (tmp_path / "packed.npz").exists()


def test_shipped_states_are_used_first(packed, store, initializer):
    assert packed.exists()
    for index in (5, 0):
        expected = initializer.points(index).astype(np.float32)
        np.testing.assert_array_equal(store.load(index), expected)
    assert calls(initializer) == []
    with pytest.raises(OutOfRangeError):
        store.load(6)


def test_loaded_states_belong_to_the_caller(packed, store, initializer):
    assert packed.exists()
    store.load(2)[:] = 0.0
    np.testing.assert_array_equal(store.load(2), initializer.points(2).astype(np.float32))


def test_shipped_states_of_other_parameters_are_ignored(packed, initializer):
    assert packed.exists()
    other = variations.VariationStore(dataclasses.replace(initializer, scale=3.0))
    np.testing.assert_array_equal(other.load(1), (3.0 * initializer.points(1)).astype(np.float32))
    assert calls(initializer) == [1]


def test_corrupt_shipped_file(packed, store):
    damage(packed)
    with pytest.raises(CorruptStoreError, match="softgym-mj generate"):
        store.load(0)
