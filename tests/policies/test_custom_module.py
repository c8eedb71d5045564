"""Tasks of a module of one's own, "module:name": on the command line, in workers, in datasets."""

import json
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from dm_control import suite

import softgym_mj
from softgym_mj import registry
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.results import read_rows
from softgym_mj.policies.experts.expert import OwnExpert
from softgym_mj.recording import record
from tests.command import status_of

HORIZON = 3
MODULE = """
from typing import Unpack

import numpy as np

import softgym_mj
from softgym_mj.entities import Rope
from softgym_mj.tasks import Measures, Task, TaskSettings


class Pull(Task):
    material = "rope"

    def __init__(self, **settings: Unpack[TaskSettings]):
        self.rope = Rope("fast")
        super().__init__([self.rope], **settings)

    def arrange(self, random):
        self.rope.set_points(self.rope.straight() + [0.0, random.uniform(-0.1, 0.1), 0.0])

    def measure(self, state, episode):
        height = float(self.actor.positions()[0, 2])
        return Measures(height, {"height": height})


class Rise(Pull):
    def expert(self):
        for i in range(3):
            yield [0.0, 0.0, 0.25 * i, -1.0] * 2


softgym_mj.register("own_pull", Pull, horizon=3, summary="Pull.")
softgym_mj.register("own_rise", Rise, horizon=3)
softgym_mj.register("own_rise_longer", Rise, horizon=4)


def half(env):
    return lambda timestep: np.full(env.task.actor.action_size, 0.5)
"""


@pytest.fixture(name="folder")
def _folder(tmp_path, monkeypatch):
    """The current folder, with the module `own_tasks`; what it registers is forgotten later."""
    (tmp_path / "own_tasks.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    modules, tasks = set(sys.modules), set(registry.TASKS)
    yield tmp_path
    for name in set(sys.modules) - modules:
        if getattr(sys.modules[name], "__file__", None) == str(tmp_path / f"{name}.py"):
            del sys.modules[name]
    for name in set(registry.TASKS) - tasks:
        gymnasium.registry.pop(registry.TASKS.pop(name).gymnasium_id)
    registry.list_in_suite()


def scores(policy, task="own_pull"):
    """Normalized performance at the end of variation 800."""
    env = softgym_mj.load(task, split="evaluate")
    for _ in env.play(lambda timestep: policy(env.step_count), 800):
        pass
    return env.info()["normalized_performance"]


@pytest.mark.usefixtures("folder")
def test_a_module_of_the_current_folder_brings_task_and_policy(capsys, monkeypatch):
    command = "rollout own_tasks:own_pull --policy own_tasks:half --episodes 1"
    assert status_of(command.split(), monkeypatch) == 0
    line = json.loads(capsys.readouterr().out)
    assert line["task"] == "own_pull"
    assert line["normalized_performance"] == scores(lambda step: np.full(8, 0.5))
    assert softgym_mj.load("own_tasks:own_pull").name == "own_pull"


@pytest.mark.usefixtures("folder")
def test_the_suite_of_dm_control_imports_the_module(monkeypatch):
    monkeypatch.syspath_prepend(".")
    env = suite.load("softgym", "own_tasks:own_pull", {"split": [800]})
    assert env.name == "own_pull"
    with pytest.raises(InvalidArgumentError, match="'own_tasks:own_pull'"):
        suite.load("softgym", "own_tasks:own_pul")
    with pytest.raises(ValueError, match="Level 'own_pul' does not exist"):
        suite.load("softgym", "own_pul")


def test_workers_find_the_module(folder, monkeypatch):
    command = "evaluate own_tasks:own_pull --policy own_tasks:half --episodes 2 --out"
    for out, jobs in (("here", 1), ("there", 2)):
        assert status_of(f"{command} {out} --jobs {jobs}".split(), monkeypatch) == 0
    here, there = ((folder / out / "result.json").read_bytes() for out in ("here", "there"))
    assert here == there
    assert json.loads(here)["episodes"][0]["normalized_performance"] == scores(
        lambda step: np.full(8, 0.5)
    )


@pytest.mark.parametrize(
    ("content", "task", "message"),
    [
        ("", "own_missing:pull", "ModuleNotFoundError: .*'own_missing'"),
        ("1 / 0", "own_broken:pull", "ZeroDivisionError.*import own_broken"),
        ("import softgym_mj as s; s.register('A', 0)", "own_broken:pull", "'soak_cloth'; `python"),
        ("", "own_broken:pull", "own_broken.py'> registers no task.*__main__"),
        ("import own_tasks", "own_broken:pul", "'own_broken:own_pull', 'own_br"),
        ("", "own_pull", "'route_cable', 'MODULE:NAME'"),
        ("", ":own_pull", "'' cannot be imported"),
    ],
)
def test_what_is_no_module_with_the_task_is_an_error(content, task, message, folder, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    (folder / "own_broken.py").write_text(content)
    with pytest.raises(InvalidArgumentError, match=message) as raised:
        registry.find(task)
    assert repr(task) in str(raised.value) and "\n" not in str(raised.value)


REPLAY = """
import minari
import numpy as np

dataset = minari.load_dataset("softgym_mj/own_pull/own_tasks-half-v0")
(episode,) = dataset.iterate_episodes()
env = dataset.recover_environment()
observation, _ = env.reset(options={"variation": int(episode.infos["variation"][0])})
for action, before, after in zip(
    episode.actions, episode.observations[:-1], episode.observations[1:], strict=True
):
    np.testing.assert_array_equal(observation, before)
    observation, *_ = env.step(action)
    np.testing.assert_array_equal(observation, after)
print(env.unwrapped.dm_env.task.actor.action_size, len(episode.actions))
"""


def test_a_dataset_plays_again_in_a_process_that_knows_nothing_of_the_task(folder, monkeypatch):
    command = "record own_tasks:own_pull --policy own_tasks:half --episodes 1"
    assert status_of(command.split(), monkeypatch) == 0
    replay = [sys.executable, "-c", REPLAY]
    played = subprocess.run(replay, cwd=folder, capture_output=True, text=True, check=False)
    assert played.stdout.split() == ["8", str(HORIZON)], played.stderr


def test_a_dataset_names_the_module_that_can_be_imported(folder, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    registry.find("own_tasks:own_pull")
    namespace = {"__name__": "notebook"}
    exec(MODULE.replace("own_", "typed_"), namespace)  # Its class is found in no module.
    for name, module in (("own_pull", "own_tasks:own_pull"), ("typed_pull", "typed_pull")):
        dataset = record(name, (800,), "zero")
        assert dataset.env_spec.kwargs["task"] == module
    (folder / "own_reexport.py").write_text("import own_tasks")
    dataset = record("own_reexport:own_pull", (800,), "zero", actor="franka", grasp="friction")
    assert dataset.spec.dataset_id == "softgym_mj/own_pull/zero-franka-friction-v0"
    actor = dataset.recover_environment().unwrapped.dm_env.task.actor
    assert actor.name == "franka/friction"
    assert dataset.env_spec.kwargs["task"] == "own_reexport:own_pull"


def test_an_expert_of_its_own_is_the_scripted_policy(folder, monkeypatch):
    expected = [np.tile([0.0, 0.0, 0.25 * i, -1.0], 2) for i in range(HORIZON)]
    assert (
        status_of(
            ["evaluate", "own_tasks:own_rise", "--episodes", "1", "--out", "expert"], monkeypatch
        )
        == 0
    )
    score = json.loads((folder / "expert" / "result.json").read_text())["summary"]["mean"]
    assert score == scores(lambda step: expected[step], "own_rise") > 0.3
    for episode in record("own_rise", (800, 801)).iterate_episodes():
        np.testing.assert_array_equal(episode.actions, expected)


def test_no_expert_or_too_short_a_one_is_an_error(folder, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    for task, message in (
        ("own_pull", r"no scripted expert for own_pull.*MODULE:FUNCTION"),
        ("own_rise_longer", r"Rise yields too few actions.*lasts 4 env steps"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            record(f"own_tasks:{task}", (800,))


def test_an_expert_that_yields_nothing_is_refused_by_name(monkeypatch):
    env = softgym_mj.load("straighten_rope", fidelity="fast")
    monkeypatch.setattr(type(env.task), "expert", lambda self: None, raising=False)
    expert = OwnExpert(env)
    with pytest.raises(InvalidArgumentError, match=r"expert\(\).*a generator"):
        expert(env.reset())


def test_an_error_in_a_task_is_a_plain_traceback_that_ends_there(folder):
    (folder / "own_wrong.py").write_text(MODULE.replace("height = float", "height = misspelled"))
    done = subprocess.run(
        [sys.executable, "-m", "softgym_mj.cli.commands", "rollout", "own_wrong:own_pull",
         "--policy", "zero", "--episodes", "1"],
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    lines = done.stderr.splitlines()
    (first,) = [i for i, line in enumerate(lines) if line.startswith("Traceback")]
    assert "own_wrong.py" in lines[-4]
    assert lines[-1] == "NameError: name 'misspelled' is not defined"
    assert all(line.startswith("  ") for line in lines[first + 1 : -1])  # No frame, no locals.


@pytest.mark.long
def test_a_task_of_ones_own_is_trained_in_processes(folder, monkeypatch):
    settings = {
        "env_steps": 8, "num_envs": 2, "part": 8, "episodes": 1, "final_episodes": 1,
        "hidden": [8, 8], "random_steps": 4, "updates": 2, "batch": 4, "replay": 16,
        "symmetric": False, "symmetrize_policy": False,
    }  # fmt: skip
    command = ["train", "sac", "own_tasks:own_pull", "--device", "host", "--jobs", "2"]
    command += ["--settings", json.dumps(settings), "--out", "own"]
    assert status_of(command, monkeypatch) == 0
    assert {row.task for row in read_rows(folder / "own" / "curve.csv")} == {"own_pull"}
