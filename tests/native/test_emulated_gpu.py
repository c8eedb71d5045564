"""The programs of batches by blocks of threads: what a GPU would do has the plugins' bits."""

import ctypes
import itertools
import pathlib
import shutil
import subprocess

import numpy as np
import pytest

from tests.cloth import test_worlds as cloth
from tests.fluid import test_worlds as water

THREADS = 16  # Of a block: two groups of eight lanes.
STEPS = 2  # Sim steps: on few cores a barrier takes long.
SOURCE = pathlib.Path(__file__).with_name("emulated_gpu.cc")
PACKAGE = SOURCE.parents[2] / "softgym_mj"


class _Emulated:
    """The library, but for the steps of batches."""

    def __init__(self, library, emulated):
        self._library = library
        for name in ("softgym_mj_cloth_batch_step", "softgym_mj_fluid_batch_step"):
            setattr(self, name, getattr(emulated, name))

    def __getattr__(self, name):
        return getattr(self._library, name)


@pytest.fixture(name="emulated", scope="module")
def _emulated(tmp_path_factory):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++")
    file = tmp_path_factory.mktemp("emulated") / "emulated_gpu.so"
    flags = ["-std=c++20", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-pthread"]
    subprocess.run([compiler, *flags, f"-I{PACKAGE}", "-o", file, SOURCE], check=True)
    return ctypes.CDLL(str(file))


@pytest.mark.parametrize(
    ("task", "variation"),
    [("rope_configuration", 806), ("fold_crumpled_cloth", 806), ("drop_cloth", 811)],
)
def test_a_block_steps_cloth_and_rope(emulated, task, variation):
    followed = cloth._Followed(task, variation, fidelity="fast")
    worlds = cloth._worlds([cloth._model(followed.env)], turns=THREADS)
    worlds._library = _Emulated(worlds._library, emulated)
    followed.place(worlds, 0)
    for told in itertools.islice(followed.steps(followed.actions(1, 0)), STEPS):
        worlds.step(*(array[None] for array in told))
        followed.check(worlds, 0)
    assert worlds.flags[0] == 0


@pytest.mark.parametrize(
    "task", ["transport_water", pytest.param("pour_water", marks=pytest.mark.slow)]
)
def test_a_block_steps_water(emulated, task):
    followed = water._Followed(task, 806)
    worlds = water._worlds([followed], turns=THREADS)
    worlds._library = _Emulated(worlds._library, emulated)
    for poses in itertools.islice(followed.steps(1), STEPS):
        worlds.step(poses[None])
        followed.check(worlds, 0)
    assert np.isfinite(worlds.positions).all()
