"""The kernels of batches by blocks of threads: what a GPU would do has the plugins' bits."""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

from tests.native.emulated_steps import draw_and_check, push_and_check, step_and_check

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


def _compile(folder, *flags):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no g++")
    file = folder / "emulated_gpu.so"
    usual = ["-std=c++20", "-ffp-contract=off", "-shared", "-fPIC", "-pthread"]
    include = f"-I{ROOT / 'softgym_mj'}"
    subprocess.run([compiler, *usual, *flags, include, "-o", file, SOURCE], check=True)
    return file


@pytest.fixture(name="emulated", scope="module")
def _emulated(tmp_path_factory):
    return _compile(tmp_path_factory.mktemp("emulated"), "-O1", "-DSGM_SOLIDS=0")


@pytest.mark.parametrize(("task", "variation"), CASES)
def test_a_block_makes_the_steps_of_the_plugin(emulated, task, variation):
    step_and_check(emulated, task, variation, OF_WATER if "water" in task else STEPS)


def test_a_block_lets_hands_push_as_a_thread_does(tmp_path):
    push_and_check(_compile(tmp_path, "-O1"), 3)


@pytest.mark.parametrize("task", ["straighten_rope", "drop_cloth", "pour_water"])
def test_a_block_draws_the_same(emulated, task):
    draw_and_check(emulated, task, 806)


@pytest.mark.slow
def test_threads_of_a_block_do_not_race(tmp_path):
    file = _compile(tmp_path, "-O1", "-g", "-fsanitize=thread", "-DBY_THREADS")
    found = subprocess.run(
        ["g++", "-print-file-name=libtsan.so"], check=True, capture_output=True, text=True
    )
    environment = {
        **os.environ,
        "LD_PRELOAD": found.stdout.strip(),
        "TSAN_OPTIONS": "exitcode=0",
        "PYTHONPATH": str(ROOT),
    }
    for task, variation in [*CASES, ("arms", 803)]:
        command = [sys.executable, "-m", "tests.native.emulated_steps"]
        outcome = subprocess.run(
            [*command, file, task, str(variation), "1"], env=environment, cwd=ROOT,
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        races = [line for line in outcome.stderr.splitlines() if "ThreadSanitizer" in line]
        assert races == [], task
