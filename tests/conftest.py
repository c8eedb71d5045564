"""Shared fixtures; a cache folder kept between runs, for simulated cloths and compiled arms."""

import gc
import os
import pathlib
import random
import signal
import sys

# Before anything imports dm_control.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("SOFTGYM_MJ_CACHE", str(pathlib.Path(__file__).parent.parent / ".test_cache"))
# JAX compiles the steps of arms and small functions, once for all test files and runs.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", f"{os.environ['SOFTGYM_MJ_CACHE']}/jax")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
import gymnasium
import numpy as np
import pytest

import softgym_mj  # Chooses the OpenGL backend.
from tests.disks import Disk

# Environments run the cycle collector, which would go through a million objects of modules and
# tests each time: a third of the time of all tests.
gc.disable()


_MANY_MODULES = 100  # That tests have imported since the last freeze: most objects are modules'.
_frozen = 0  # Modules at the last freeze.


def pytest_collection_finish():
    """Leaves what has been imported and collected out of later collections."""
    _freeze()
    gc.enable()


def pytest_runtest_logfinish():
    """Leaves what the tests have imported out as well: PyTorch alone is 200,000 objects."""
    if len(sys.modules) >= _frozen + _MANY_MODULES:
        _freeze()


def _freeze():
    global _frozen  # noqa: PLW0603 - the collector is one for the process, too.
    _frozen = len(sys.modules)
    gc.collect()
    gc.freeze()


def pytest_unconfigure():
    """Has nanobind find its functions, of which it would name those that are left."""
    gc.unfreeze()


@pytest.fixture(autouse=True)
def _seeds(monkeypatch):
    """Each test draws the same random numbers, also by generators that it leaves without a seed."""
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - the global generator, too.
    monkeypatch.setattr(np.random.bit_generator, "randbits", random.Random(0).getrandbits)
    if "torch" in sys.modules:
        sys.modules["torch"].manual_seed(0)


@pytest.fixture(autouse=True)
def _interrupts():
    """Ctrl-C does what it did before: an interrupted command has it end the process."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.SIG_IGN:  # A shell's background processes ignore it: they would go on.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, usual)


@pytest.fixture(name="disk")
def _disk(tmp_path):
    """A `Disk` of 1 MB."""
    with Disk(tmp_path / "disk") as disk:
        yield disk


@pytest.fixture(name="own_datasets")
def _own_datasets(tmp_path, monkeypatch):
    """Minari's datasets of a test are in its folder."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))


@pytest.fixture(name="register")
def _register():
    """`softgym_mj.register` for the time of a test."""
    records = []

    def add(name, constructor, **settings):
        records.append(softgym_mj.register(name, constructor, **settings))
        return records[-1]

    yield add
    for record in records:
        softgym_mj.TASKS.pop(record.name, None)
        gymnasium.registry.pop(record.gymnasium_id, None)
    softgym_mj.registry.list_in_suite()
