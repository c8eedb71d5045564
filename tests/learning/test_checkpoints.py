"""Checkpoints: written within parts, checked when they are read, in a folder of one training."""

import io
import json
import pickle
import random
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import torch

from softgym_mj.exceptions import StoreError
from softgym_mj.learning.checkpoints import FILE, PREVIOUS, alone, read_checkpoint, write_checkpoint
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training

METHOD = find_method("sac", hidden=(8,), random_steps=4, updates=2, batch=4, replay=16)
SETTINGS = TrainingSettings(
    "straighten_rope", env_steps=24, num_envs=2, part=12, evaluate_every=2, episodes=1,
    final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip


def _training(folder):
    return Training(SETTINGS, METHOD, [4, 9], folder, "host")


# ---------------------------------------------------------------------- damaged files


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    training = _training(folder)
    training.play = None  # Killed by the first evaluation.
    with pytest.raises(TypeError):
        training.run()
    assert (folder / FILE).exists() and (folder / PREVIOUS).exists()
    return folder


def _saved(content):
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


def _zip():
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("data.pkl", pickle.dumps({"done": 1}))
    return buffer.getvalue()


DAMAGED = {
    "empty": lambda good: b"",
    "one byte": lambda good: good[:1],
    "half": lambda good: good[: len(good) // 2],
    "without its checksum": lambda good: good[:-64],
    "without its last byte": lambda good: good[:-1],
    "with a byte more": lambda good: good + b"0",
    "twice": lambda good: good * 2,
    "zeros": lambda good: bytes(len(good)),
    "text": lambda good: b"a checkpoint\n" * 9,
    "JSON": lambda good: json.dumps({"owner": {}}).encode() * 9,
    "pickle": lambda good: pickle.dumps({"done": 1}) * 9,
    "NumPy": lambda good: np.arange(99.0).tobytes(),
    "zip": lambda good: _zip(),
    "PyTorch": lambda good: _saved({"owner": {}, "learner": {}}),
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_files_are_refused(folder, tmp_path, kind):
    good = (folder / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(DAMAGED[kind](good))
    with pytest.raises(StoreError, match=r"checkpoint\.pt is damaged.*delete it to begin anew"):
        read_checkpoint(tmp_path)
    (tmp_path / PREVIOUS).write_bytes(good)
    with pytest.raises(StoreError, match=r"delete it to continue from .*checkpoint\.previous\.pt"):
        read_checkpoint(tmp_path)
    (tmp_path / FILE).unlink()
    assert read_checkpoint(tmp_path)["done"] == 2


def test_single_bits_are_noticed(folder, tmp_path):
    good, chance = (folder / FILE).read_bytes(), random.Random(3)
    for _ in range(50):
        bad = bytearray(good)
        bad[chance.randrange(len(bad))] ^= 1 << chance.randrange(8)
        (tmp_path / FILE).write_bytes(bad)
        with pytest.raises(StoreError, match="checksum"):
            read_checkpoint(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state["learner"].pop("algorithm"),
        lambda state: state["learner"].update(algorithm={}),
        lambda state: state["learner"].update(noise=[]),
        lambda state: state["learner"]["algorithm"]["critics"].update(
            {name: a[:1] for name, a in state["learner"]["algorithm"]["critics"].items()}
        ),
        lambda state: state.update(learner=None),
        lambda state: state.update(part=[]),
        lambda state: state.pop("rows"),
        lambda state: state.update(more=1),
    ],
)
def test_other_contents_are_refused(folder, tmp_path, change):
    state = read_checkpoint(folder)
    change(state)
    write_checkpoint(tmp_path, state)
    with pytest.raises(StoreError, match=r"checkpoint\.pt is damaged, or no checkpoint"):
        _training(tmp_path).run()


def test_code_is_not_run(tmp_path):
    class Code:
        def __reduce__(self):
            return (pytest.fail, ("code of a checkpoint",))

    write_checkpoint(tmp_path, {"owner": Code()})
    with pytest.raises(StoreError, match=r"[Ww]eights.only"):
        read_checkpoint(tmp_path)


def test_a_killed_rotation_leaves_the_previous_checkpoint(folder, tmp_path):
    (tmp_path / PREVIOUS).write_bytes((folder / FILE).read_bytes())
    starts = []
    _training(tmp_path).run(on_start=lambda now: starts.append(now.done))
    assert starts == [2]
    assert torch.load(tmp_path / FILE, weights_only=True)["done"] == 2  # PyTorch reads it as well.


# ---------------------------------------------------------------------- one training a folder


def test_a_folder_has_one_training_at_a_time(tmp_path):
    code = (
        "import pathlib, sys\n"
        "from softgym_mj.learning.checkpoints import alone\n"
        "with alone(pathlib.Path(sys.argv[1])):\n"
        "    print('locked', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "locked\n"
    message = f"{tmp_path.name} is in use by another training, process {process.pid} on "
    with pytest.raises(StoreError, match=message):
        _training(tmp_path).run()
    process.kill()  # The lock ends with its process.
    process.communicate()
    with alone(tmp_path), pytest.raises(StoreError, match="in use"), alone(tmp_path):
        pass
    with alone(tmp_path):
        pass
