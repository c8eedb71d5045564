"""Files of strangers: none is loaded unless the user trusts it, as it runs what is in it."""

import contextlib
import io
import json
import os
import pathlib
import pickle
import subprocess
import sys
import zipfile

import pytest

import softgym_mj
from softgym_mj.evaluation import Configuration, evaluate
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.episodes import play
from softgym_mj.policies.factory import make_policy
from softgym_mj.recording import record
from softgym_mj.viewing.session import Session
from tests.command import status_of
from tests.policies.test_saved_policies import exported

SHORT = {"horizon": 2}
MARK = "executed"  # The file that whatever is executed makes.
CALL = f"__import__('pathlib').Path('{MARK}').touch()"


class Payload:
    """Makes the file when it is unpickled."""

    def __reduce__(self):
        return eval, (CALL,)


def pickled():
    return pickle.dumps(Payload())


def saved(**settings):
    import torch

    content = io.BytesIO()
    torch.save(Payload(), content, **settings)
    return content.getvalue()


def scripted():
    import torch

    content = io.BytesIO()
    torch.jit.save(torch.jit.trace(torch.nn.Linear(3, 2), torch.zeros(1, 3)), content)
    return content.getvalue()


def archive(member, edit, **more):
    """What `torch.export.save` writes, with an edited member and further ones."""
    content = io.BytesIO()
    exported(content)
    result = io.BytesIO()
    with zipfile.ZipFile(content) as source, zipfile.ZipFile(result, "w") as target:
        for name in source.namelist():
            output = source.read(name)
            target.writestr(name, edit(output) if name.endswith(member) else output)
        root = source.namelist()[0].split("/")[0]
        for name, data in more.items():
            target.writestr(f"{root}/data/{name}/model.pt", data)
    return result.getvalue()


def guarded(model):
    content = json.loads(model)
    content["guards_code"] = [f"{CALL} or True"]
    return json.dumps(content).encode()


def sized(model):
    content = json.loads(model)
    values = content["graph_module"]["graph"]["tensor_values"]
    next(iter(values.values()))["sizes"][0] = {"as_expr": {"expr_str": CALL, "hint": None}}
    return json.dumps(content).encode()


KINDS = {
    "pickle": pickled,
    "torch.save": saved,
    "old torch.save": lambda: saved(_use_new_zipfile_serialization=False),
    "TorchScript": scripted,
    "sample inputs": lambda: archive("sample_inputs/model.pt", lambda found: saved()),
    "weights": lambda: archive("-", bytes, weights=saved()),
    "constants": lambda: archive("-", bytes, constants=saved()),
    # No pickle at all: JSON, of which torch executes guards and the sizes of tensors.
    "guards": lambda: archive("models/model.json", guarded),
    "sizes": lambda: archive("models/model.json", sized),
}
BY_TORCH = ("sample inputs", "weights", "constants", "guards", "sizes")  # What it executes today.


@pytest.fixture(name="env", scope="module")
def _env():
    return softgym_mj.load("straighten_rope", split="all", **SHORT)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_runs_nothing_unless_it_is_trusted(kind, env, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("policy.pt2").write_bytes(KINDS[kind]())
    for trust in (False, 0, "no", None):
        with pytest.raises(InvalidArgumentError, match=r"policy\.pt2"):
            make_policy("policy.pt2", env, trust=trust)
    assert os.listdir() == ["policy.pt2"]
    if kind in BY_TORCH:  # The attacks are real ones.
        with contextlib.suppress(InvalidArgumentError):  # Some load as if nothing had happened.
            make_policy("policy.pt2", env, trust=True)(env.reset(800))
        assert MARK in os.listdir()


def test_trust_is_asked_for_everywhere(env, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    pathlib.Path("policy.pt2").write_bytes(KINDS["guards"]())
    task, policy = "straighten_rope", "policy.pt2"
    configuration = Configuration(task, policy, (800,), (0,), SHORT)
    for way in (
        lambda: play(env, policy, 800, camera=None),
        lambda: evaluate(configuration, "run"),
        lambda: record(task, [0], policy, **SHORT),
        lambda: Session(task, policy),
    ):
        with pytest.raises(InvalidArgumentError, match=r"can run any code.*trust=True.*--trust"):
            way()
    assert not pathlib.Path(MARK).exists()


@pytest.mark.parametrize(
    "command",
    [
        "rollout straighten_rope --episodes 1",
        'evaluate straighten_rope --episodes 1 --task-settings {"horizon":2}',
        'record straighten_rope --episodes 1 --task-settings {"horizon":2}',
    ],
    ids=lambda command: command.split()[0],
)
def test_the_command_line_trusts_who_says_so(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    exported("policy.pt2")
    arguments = [*command.split(), "--policy", "policy.pt2"]
    for more, status in ([], 1), (["--trust"], 0):
        assert status_of(arguments + more, monkeypatch) == status
    assert "InvalidArgumentError: policy='policy.pt2' is not loaded" in capsys.readouterr().err


def test_without_trust_torch_is_not_even_imported(tmp_path):
    exported(tmp_path / "policy.pt2")
    script = """
import sys, softgym_mj
from softgym_mj.policies.factory import make_policy
try:
    make_policy("policy.pt2", softgym_mj.load("straighten_rope"))
except softgym_mj.exceptions.InvalidArgumentError:
    print("torch.export" in sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"
