"""Methods of other modules: trained by name, published in the same format."""

import dataclasses
import json
import pathlib
import re
import shlex

import pytest
import torch

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, UnexportableError
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.results import read_folder
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training
from tests.command import output_of

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "custom_methods.md"
NAME = "tests.learning.test_plugins:make"
SHORT = {
    "env_steps": 4, "num_envs": 2, "part": 4, "episodes": 1, "final_episodes": 1,
    "fidelity": "fast", "episode_steps": 3,
}  # fmt: skip
PRESETS = {
    "still": {
        "training": SHORT, "method": {"push": 0.25},
        "tasks": {"drop_cloth": {"method": {"push": 0.75}, "training": {"episodes": 2}}},
    },
    "other": {},
    "wide": {"based_on": "still", "method": {"hidden": [16], "push": 0.5}},
    "lost": {"based_on": "none"},
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of a method."""

    push: float = 0.5
    hidden: tuple[int, ...] = (8,)


def make(settings: Settings, problem: Problem) -> None:
    """Returns no learner."""


def untyped(settings, problem):
    """A method whose settings have no annotation."""


def test_the_learner_of_the_page_is_trained_and_continued(tmp_path, monkeypatch):
    section = PAGE.read_text()
    (code,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    (tmp_path / "search.py").write_text(code)
    (command,) = re.findall(r"^softgym-mj (train search:make .*)", section, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    rows = {}
    for folder, lengths in {"once": (8,), "twice": (4, 8)}.items():
        for env_steps in lengths:
            settings = json.dumps({**SHORT, "env_steps": env_steps})
            replaced = ["--out", folder, "--seeds", "2", "--settings", settings]
            output_of(*shlex.split(command), *replaced)
        last = read_folder(tmp_path / folder)[-4:]
        assert {(row.method, row.preset) for row in last} == {("search:make", "custom")}
        rows[folder] = [row.normalized_performance for row in last]
        assert (tmp_path / folder / "policy_1.pt2").exists()
    assert rows["once"] == rows["twice"]


def test_presets_and_settings_of_another_module():
    training, method = find_preset(NAME, "still", "fold_cloth", env_steps=8, push=1.0)
    assert (training.env_steps, method.settings.push, method.preset) == (8, 1.0, "custom")
    assert find_preset(NAME, "other", "fold_cloth")[1].settings == Settings()
    with pytest.raises(InvalidArgumentError, match=r"preset='none'.*'still'"):
        find_preset(NAME, "lost", "fold_cloth")
    with pytest.raises(InvalidArgumentError, match=r"preset='fast'.*'still'"):
        find_preset(NAME, "fast", "fold_cloth")
    with pytest.raises(InvalidArgumentError, match=r"settings='pull'.*'push'"):
        find_preset(NAME, "still", "fold_cloth", pull=1.0)
    with pytest.raises(InvalidArgumentError, match="hidden=0"):
        find_method(NAME, hidden=(0,))


def test_a_preset_replaces_some_settings_of_another():
    training, method = find_preset(NAME, "wide", "drop_cloth")
    assert (training.env_steps, training.episodes) == (4, 2)  # A task's count for it, too,
    assert method.settings == Settings(0.5, (16,)) and method.preset == "wide"  # but its own more.


@pytest.mark.parametrize(
    "name, message",
    [
        ("no_such_module:make", "ModuleNotFoundError"),
        (f"{__name__}:nothing", "AttributeError"),
        (f"{__name__}:untyped", "being a dataclass"),
        (f"{__name__}:NAME", "TypeError"),
        ("sacc", "'sac'.*'MODULE:FUNCTION'"),
    ],
)
def test_what_is_no_method_is_refused(name, message):
    with pytest.raises(InvalidArgumentError, match=f"(?s)method=.*{message}"):
        find_method(name)


def test_a_method_that_makes_no_learner_is_refused(tmp_path):
    method = find_method(NAME)
    with pytest.raises(InvalidArgumentError, match=r"make.*None.*Learner"):
        Training(TrainingSettings("straighten_rope", **SHORT), method, [0], tmp_path, "host")


class Still:
    """A learner whose actions are zeros; an error where its policy is expected."""

    updates = 0

    def __init__(self, problem, error):
        self.problem, self.error = problem, error

    def act(self, observation, first, memory, *, explore):
        return torch.zeros(*first.shape, self.problem.action), memory

    def learn(self, step):
        return {}

    def policy(self, seed):
        raise self.error

    def get_state(self):
        return {}


@pytest.mark.parametrize("kind", [UnexportableError, InvalidArgumentError])
def test_only_policies_that_cannot_be_exported_are_left_out(tmp_path, kind):
    def learner(settings, problem):
        return Still(problem, kind("method", "still", "a module"))

    method = dataclasses.replace(find_method(NAME), make=learner)
    training = Training(TrainingSettings("straighten_rope", **SHORT), method, [0], tmp_path, "host")
    if kind is UnexportableError:
        training.run()
    else:
        with pytest.raises(InvalidArgumentError, match="method='still' is not valid"):
            training.run()
    assert len(read_folder(tmp_path)) == 2 and not [*tmp_path.glob("policy*")]
