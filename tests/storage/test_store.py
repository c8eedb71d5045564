"""The store: byte comparison, damage, and runs that fail, are killed and go on."""

import functools
import itertools
import os
import pathlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from softgym_mj.exceptions import StoreError
from softgym_mj.parallel.executors import make_executor
from softgym_mj.storage.store import ARRAYS, JSON, Store

SPECIFICATION = {"task": "rope", "settings": {"size": (3, 4), "scale": 0.1}}
ARRAY_VALUE = {
    "points": np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32),
    "infos/success": np.array([False, True]),
    "empty": np.zeros((0, 2), np.uint8),
}
JSON_VALUE = {"score": 0.1 + 0.2, "worst": -float("inf"), "cpu": None, "plan": [1, 2.0]}


@pytest.fixture(name="store")
def _store(tmp_path) -> Store:
    return Store(tmp_path / "deep" / "folder", SPECIFICATION, JSON)


def contents(store: Store) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in sorted(store.folder.iterdir())}


# ---------------------------------------------------------------- values


def test_arrays_come_back(tmp_path):
    store = Store(tmp_path, SPECIFICATION, ARRAYS)
    store.put(3, ARRAY_VALUE)
    result = store.get(3)
    assert list(result) == list(ARRAY_VALUE)
    for name, array in ARRAY_VALUE.items():
        np.testing.assert_array_equal(result[name], array)
        assert result[name].dtype == array.dtype


def test_json_comes_back(store):
    store.put(3, JSON_VALUE)
    result = store.get(3)
    assert list(result.items()) == list(JSON_VALUE.items())


def test_a_key_has_a_file(store):
    names = {
        4: "0004",
        12345: "12345",
        (800, 0): "0800_0000",
        ("rope", "franka", 7): "rope_franka_0007",
    }
    for key in names:
        assert not store.has(key)
        with pytest.raises(FileNotFoundError):
            store.get(key)
        store.put(key, key)
        assert store.has(key)
    files = {f"{name}.value" for name in names.values()}
    assert set(contents(store)) == files | {"specification.json"}


@pytest.mark.parametrize(("codec", "value"), [(ARRAYS, ARRAY_VALUE), (JSON, JSON_VALUE)])
def test_the_same_value_gives_the_same_bytes(codec, value, tmp_path, monkeypatch):
    now, later = (Store(tmp_path / name, SPECIFICATION, codec) for name in ("now", "later"))
    now.put(1, value)
    # Zip entries can hold a time of day; another day must give the same file.
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2_000_000_000))
    monkeypatch.setattr(time, "time", lambda: 2e9)
    later.put(1, value)
    assert contents(now) == contents(later)


# ---------------------------------------------------------------- damage


@pytest.fixture(name="file", params=["arrays", "json"])
def _file(request, tmp_path) -> tuple[Store, pathlib.Path]:
    arrays = {"points": ARRAY_VALUE["points"]}
    codec, value = {"arrays": (ARRAYS, arrays), "json": (JSON, JSON_VALUE)}[request.param]
    store = Store(tmp_path, SPECIFICATION, codec)
    store.put(1, value)
    return store, store.file(1)


def test_truncated_at_any_length(file):
    store, path = file
    content = path.read_bytes()
    for length in range(len(content)):
        path.write_bytes(content[:length])
        with pytest.raises(StoreError):
            store.get(1)


def test_any_altered_byte(file):
    store, path = file
    content = path.read_bytes()
    for position, mask in itertools.product(range(len(content)), (0x01, 0xFF)):
        damaged = bytearray(content)
        damaged[position] ^= mask
        path.write_bytes(bytes(damaged))
        with pytest.raises(StoreError):
            store.get(1)


def test_no_value_at_all(store):
    store.put(1, JSON_VALUE)
    for content in (b"", b"\n", b"{}\n{}", b"[" * 10**5, bytes(1000)):
        store.file(1).write_bytes(content)
        with pytest.raises(StoreError, match=r"0001\.value cannot be read: it begins.*; delete it"):
            store.get(1)
    store.file(1).unlink()
    store.file(1).mkdir()
    with pytest.raises(StoreError, match=r"0001\.value cannot be read: it is not a file"):
        store.get(1)


def test_a_file_in_the_place_of_another_key(store):
    for key in (1, (1, 0), (1, 2)):
        store.put(key, JSON_VALUE)
    for key, other in itertools.permutations((1, (1, 0), (1, 2)), 2):
        before = store.file(key).read_bytes()
        store.file(key).write_bytes(store.file(other).read_bytes())
        with pytest.raises(StoreError, match=r"\.value cannot be read"):
            store.get(key)
        store.file(key).write_bytes(before)
    store.put(("a", "b"), 1)
    with pytest.raises(StoreError):  # The name of its file is the same.
        store.get("a_b")


def test_a_file_of_another_specification(store, tmp_path):
    settings = {**SPECIFICATION["settings"], "scale": 0.2}
    for i, change in enumerate(({"task": "cloth"}, {"settings": settings}, {"a": 1})):
        other = Store(tmp_path / f"{i}", {**SPECIFICATION, **change}, JSON)
        other.put(1, JSON_VALUE)
        store.put(1, JSON_VALUE)
        store.file(1).write_bytes(other.file(1).read_bytes())
        with pytest.raises(StoreError):
            store.get(1)


# ---------------------------------------------------------------- specifications


def test_a_folder_has_one_specification(store):
    folder = store.folder
    other = Store(folder, {"task": "cloth", "settings": SPECIFICATION["settings"], "a": 1}, JSON)
    assert store.is_empty() and not folder.exists()
    store.claim()  # Without a value it is anybody's.
    assert store.is_empty() and other.differences() == []
    store.put(1, JSON_VALUE)
    assert not store.is_empty()
    assert Store(folder, SPECIFICATION, JSON).differences() == []
    assert other.differences() == ["task", "a"]
    (folder / "specification.json").write_text("{")
    with pytest.raises(StoreError, match=r"specification\.json cannot be read"):
        other.differences()


# ---------------------------------------------------------------- runs


def value(log: str, failing: int, delay: float, index: int) -> list[float]:
    """Cheap numbers; the call leaves a line in the file `log`."""
    with open(log, "a") as stream:
        stream.write(f"{index}\n")
    if index == failing:
        raise ArithmeticError(f"value {index} fails on purpose")
    time.sleep(delay)
    return np.random.default_rng(index).normal(size=3 + index % 4).tolist()


@pytest.fixture(name="log")
def _log(tmp_path) -> pathlib.Path:
    (tmp_path / "log").touch()
    return tmp_path / "log"


def function(log: pathlib.Path, failing: int = -1, delay: float = 0.0):
    return functools.partial(value, str(log), failing, delay)


def calls(log: pathlib.Path) -> list[int]:
    """The values made so far, in order."""
    return [int(line) for line in log.read_text().split()]


def expected_contents(keys, tmp_path) -> dict[str, bytes]:
    """The files of values that are put one by one."""
    store = Store(tmp_path / "reference", SPECIFICATION, JSON)
    for key in keys:
        store.put(key, value(os.devnull, -1, 0.0, key))
    return contents(store)


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_goes_on(store, log, jobs, tmp_path):
    store.run((1, 2, 5), function(log))
    for key in (1, 2):
        os.utime(store.file(key), ns=(10**18, 10**18))
    seen = {}
    with make_executor(jobs) as executor:
        assert store.run(range(6), function(log), executor, seen.__setitem__) == 3
        assert sorted(calls(log)[3:]) == [0, 3, 4]
        assert seen == {key: value(os.devnull, -1, 0.0, key) for key in range(6)}
        assert list(seen)[:3] == [1, 2, 5]  # What is there comes first.
        assert contents(store) == expected_contents(range(6), tmp_path)
        assert [store.file(key).stat().st_mtime_ns for key in (1, 2)] == [10**18] * 2
        assert store.run(range(6), function(log), executor) == 0
    store.run([(2, 3)], pow)  # The parts of a key are arguments.
    assert store.get((2, 3)) == 8


def test_damage_is_an_error_or_replaced(store, log):
    store.run(range(4), function(log))
    before = contents(store)
    store.file(2).write_bytes(before["0002.value"][:-1])
    with pytest.raises(StoreError, match=r"0002\.value"):
        store.run(range(5), function(log))
    assert calls(log) == [0, 1, 2, 3]
    seen = []
    note = lambda key, _: seen.append(key)  # noqa: E731
    assert store.run(range(4), function(log), None, note, replace=True) == 1
    assert seen == [0, 1, 3, 2] and calls(log) == [0, 1, 2, 3, 2]
    assert contents(store) == before


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_failure_leaves_what_is_finished(store, log, jobs, tmp_path):
    with make_executor(jobs) as executor:
        with pytest.raises(ArithmeticError, match="value 3 fails"):
            store.run(range(5), function(log, failing=3, delay=0.2), executor)
        # The error comes when nothing runs any more: what was started, elsewhere too, is there.
        started = set(calls(log))
        assert [key for key in range(5) if store.has(key)] == sorted(started - {3})
        assert started == {0, 1, 2, 3} if jobs == 1 else started >= {0, 1, 3}
        store.run(range(5), function(log), executor)  # The cause is removed.
    assert contents(store) == expected_contents(range(5), tmp_path)


# With a third argument it kills itself in the write of that many values.
SCRIPT = """
import os, pathlib, signal, sys
from tests.storage import test_store as module

if len(sys.argv) > 3:
    replace, left = os.replace, [int(sys.argv[3])]
    def dying_replace(source, target):
        left[0] -= target.suffix == ".value"
        if not left[0]:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(source, target)
    os.replace = dying_replace
store = module.Store(pathlib.Path(sys.argv[1]), module.SPECIFICATION, module.JSON)
function = module.function(sys.argv[2])
store.run(range(12), function, None, lambda key, value: print(key, flush=True))
"""


def start(*arguments: object) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *map(str, arguments)],
        cwd=pathlib.Path(__file__).parents[2],  # Where it finds the tests.
        stdout=subprocess.PIPE,
        text=True,
    )


def test_kill_in_a_write_and_resume(store, log, tmp_path):
    with start(store.folder, log, 5) as process:
        process.communicate()
    assert process.returncode == -signal.SIGKILL
    expected = expected_contents(range(12), tmp_path)
    finished = {file.name: file.read_bytes() for file in store.folder.glob("*.value")}
    assert len(finished) == 4
    assert finished.items() <= expected.items()

    with start(store.folder, log) as process:
        seen = sorted(map(int, process.stdout))
    assert process.returncode == 0 and seen == list(range(12))
    assert {file.name: file.read_bytes() for file in store.folder.glob("[!.]*")} == expected
    assert max(calls(log).count(key) for key in range(len(finished))) == 1
