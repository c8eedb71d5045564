"""A training whose process is killed at any moment ends with the same files."""

import csv
import json
import random
import subprocess
import sys
import time

import pytest
import torch

from tests.vector.same import same

SETTINGS = {
    "env_steps": 640, "num_envs": 4, "part": 64, "episodes": 1, "final_episodes": 2,
    "fidelity": "fast", "episode_steps": 20, "random_steps": 64, "updates": 4, "batch": 64,
    "replay": 400, "hidden": [32, 32],
}  # fmt: skip
KILLS = 5


def _start(folder):
    command = [sys.executable, "-m", "softgym_mj.cli.commands", "train", "sac", "straighten_rope"]
    command += ["--seeds", "2", "--device", "host", "--settings", json.dumps(SETTINGS)]
    return subprocess.Popen(
        [*command, "--out", str(folder)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )


def _ended(folder):
    process = _start(folder)
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 0, output.decode()
    with (folder / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    seconds = [float(row.pop("seconds")) for row in rows]
    state = torch.load(folder / "checkpoint.pt", weights_only=True)
    return rows, state["learner"]["algorithm"], seconds[-1]


def _killed(folder, delay):
    """Kills a training some seconds after its next checkpoint; whether it still ran."""
    file = folder / "checkpoint.pt"
    before, process = file.exists() and file.stat().st_mtime_ns, _start(folder)
    while process.poll() is None and (file.exists() and file.stat().st_mtime_ns) == before:
        time.sleep(0.002)
    time.sleep(delay)
    is_running = process.poll() is None
    process.kill()
    process.communicate()
    return is_running


@pytest.mark.slow
def test_kills_at_random_moments_change_nothing(tmp_path):
    rows, weights, seconds = _ended(tmp_path / "whole")
    chance = random.Random(1)
    part = seconds * SETTINGS["part"] / SETTINGS["env_steps"]  # However fast the machine is.
    caught = sum(_killed(tmp_path / "killed", chance.uniform(0.0, part)) for _ in range(KILLS))
    again, result, _ = _ended(tmp_path / "killed")
    assert caught >= 2  # Some were not through.
    assert again == rows and len(rows) == 10 * 2 * 2
    assert same(result, weights)
