"""Executors: order, errors, and what happens when a worker is killed."""

import os
import pathlib
import signal
import subprocess
import sys
import time
import weakref

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.parallel.executors import (
    Executor,
    ProcessExecutor,
    RayExecutor,
    SerialExecutor,
    make_executor,
)

RAY = pytest.param("ray", marks=pytest.mark.long)  # It takes its time to start.


@pytest.fixture(name="executor", params=["serial", "processes", RAY], scope="module")
def _executor(request):
    kinds = {
        "serial": SerialExecutor,
        "processes": lambda: ProcessExecutor(2),
        "ray": lambda: RayExecutor(number=2),
    }
    with kinds[request.param]() as executor:
        yield executor


def square(value: int) -> int:
    return value * value


def note(folder: str, name: object) -> int:
    """Leaves a file for this call; returns how many it has left."""
    files = pathlib.Path(folder)
    (files / f"{name}_{time.time_ns()}_{os.getpid()}").touch()
    return len(list(files.glob(f"{name}_*")))


def die_once(folder: str, index: int) -> int:
    """Kills its process at the first try of call 3."""
    if note(folder, index) == 1 and index == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return 10 * index


def die(index: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def fail_at_two(folder: str, index: int) -> int:
    if index == 2:
        raise ArithmeticError("call 2 fails")
    note(folder, index)
    time.sleep(0.1)  # Still at work when call 2 fails.
    return index


def test_results_come_in_order_whoever_computes_them(executor: Executor):
    assert executor.all(square, [(i,) for i in range(9)]) == [i * i for i in range(9)]
    assert sorted(executor.results(square, [(2,), (3,)])) == [(0, 4), (1, 9)]
    assert executor.all(square, []) == []


def test_results_are_not_kept(executor: Executor):
    seen = []
    for _, array in executor.results(np.zeros, [(3,)] * 5):
        assert [reference() is None for reference in seen[:-1]] == [True] * (len(seen) - 1)
        seen.append(weakref.ref(array))
    assert len(seen) == 5


def test_the_error_of_a_call_comes_after_what_had_begun(executor: Executor, tmp_path):
    result = []
    with pytest.raises(ArithmeticError, match="call 2 fails"):
        for index, value in executor.results(fail_at_two, [(str(tmp_path), i) for i in range(6)]):
            assert index == value
            result.append(index)
    begun = {int(file.name.split("_")[0]) for file in tmp_path.iterdir()}
    assert begun == set(result)
    assert executor.all(square, [(4,)]) == [16]  # They are still good.


@pytest.mark.parametrize("executor", ["processes", RAY], indirect=True)
def test_a_killed_worker_is_replaced_and_nothing_counts_twice(executor: Executor, tmp_path):
    result = executor.results(die_once, [(str(tmp_path), i) for i in range(8)])
    assert sorted(result) == [(i, 10 * i) for i in range(8)]
    assert len(list(tmp_path.glob("3_*"))) == 2  # The lost call was made again.


def test_workers_that_always_die_are_an_error():
    with ProcessExecutor(1) as executor, pytest.raises(SimulationError, match="3 times in a row"):
        executor.all(die, [(0,)])


def test_numbers():
    assert make_executor().number == 1 and isinstance(make_executor(), SerialExecutor)
    assert make_executor(3).number == 3
    for jobs in (0, -2, 1.5):
        with pytest.raises(InvalidArgumentError, match=f"jobs={jobs}"):
            make_executor(jobs)


def test_scripts_need_no_guard():
    script = (
        "import math\nfrom softgym_mj.parallel.executors import ProcessExecutor\n"
        "print('script')\nwith ProcessExecutor(2) as executor:\n"
        "    print(executor.all(math.isqrt, [(9,), (16,)]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-"], input=script, capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "script\n[3, 4]\n"
