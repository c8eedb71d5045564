"""The kernels of batches by blocks of threads: what a GPU would do has the plugins' bits."""

import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import pytest

from softgym_mj.native.caches import cache_folder
from tests.native.emulated_steps import (
    draw_and_check,
    halves_and_check,
    lie_and_check,
    push_and_check,
    step_and_check,
)

SOURCE = pathlib.Path(__file__).with_name("emulated_gpu.cc")
ROOT = SOURCE.parents[2]
STEPS, OF_WATER = 8, 2  # Sim steps.
CASES = [
    ("rope_configuration", 806),
    ("fold_crumpled_cloth", 806),
    ("drop_cloth", 811),
    ("transport_water", 806),
    ("pour_water", 806),
    ("transport_water/sawyer", 806),
]


def _compile(*flags):
    """Compiles the kernels unless the cache has them, of the same preprocessed source."""
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++")
    usual = ["-std=c++20", "-ffp-contract=off", "-shared", "-fPIC", "-pthread"]
    command = [compiler, *usual, *flags, f"-I{ROOT / 'softgym_mj'}", SOURCE]
    source = subprocess.run([*command, "-E", "-P"], check=True, capture_output=True).stdout
    version = subprocess.run([compiler, "--version"], check=True, capture_output=True).stdout
    key = hashlib.sha256(repr((source, version, flags)).encode()).hexdigest()
    file = cache_folder() / "emulated_gpu" / f"{key}.so"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent) as folder:
            made = pathlib.Path(folder) / file.name
            subprocess.run([*command, "-o", made], check=True)
            made.replace(file)
    return file


@pytest.fixture(name="emulated", scope="module")
def _emulated():
    return _compile("-O1", "-DSGM_SOLIDS=0")


@pytest.mark.parametrize(("task", "variation"), CASES)
def test_a_block_makes_the_steps_of_the_plugin(emulated, task, variation):
    step_and_check(emulated, task, variation, OF_WATER if "water" in task else STEPS)


@pytest.mark.long
def test_halves_of_a_block_make_the_steps_of_the_plugin():
    file = _compile("-O1", "-DSGM_SOLIDS=0", "-DSGM_HALVES", "-DSGM_THREADS=32")
    halves_and_check(file, "transport_water", (806, 810, 803, 801), OF_WATER)


@pytest.mark.parametrize(
    ("threads", "steps"), [pytest.param(16, 3, marks=pytest.mark.long), (128, 2)]
)
def test_a_block_lets_hands_push_as_a_thread_does(threads, steps):
    push_and_check(_compile("-O1"), steps, threads)


@pytest.mark.parametrize("flex", ["cloth", "rope"])
def test_a_block_lays_a_flex_on_meshes_as_the_plugin_does(flex):
    lie_and_check(_compile("-O1"), flex, 3)


@pytest.mark.parametrize("task", ["straighten_rope", "drop_cloth", "pour_water"])
def test_a_block_draws_the_same(emulated, task):
    draw_and_check(emulated, task, 806)


@pytest.mark.slow
def test_threads_of_a_block_do_not_race():
    file = _compile("-O1", "-g", "-fsanitize=thread", "-DBY_THREADS")
    found = subprocess.run(
        ["g++", "-print-file-name=libtsan.so"], check=True, capture_output=True, text=True
    )
    environment = {
        **os.environ,
        "LD_PRELOAD": found.stdout.strip(),
        "TSAN_OPTIONS": "exitcode=0",
        "PYTHONPATH": str(ROOT),
    }
    for task, variation in [*CASES, ("arms", 803), ("cloth", 0), ("rope", 0)]:
        command = [sys.executable, "-m", "tests.native.emulated_steps"]
        outcome = subprocess.run(
            [*command, file, task, str(variation), "1"], env=environment, cwd=ROOT,
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        races = [line for line in outcome.stderr.splitlines() if "ThreadSanitizer" in line]
        assert races == [], task
