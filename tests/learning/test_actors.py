"""Trainings with arms: rows of their own from preset to table, and policies that play with them."""

import dataclasses
import json

import pytest
import torch

import softgym_mj
from softgym_mj.cli import training as cli
from softgym_mj.cli.console import PUBLISHED, policy_file
from softgym_mj.evaluation.comparison import read_results
from softgym_mj.evaluation.configuration import Configuration
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning import results
from softgym_mj.learning.learner import Problem
from softgym_mj.learning.methods.distill import LABEL
from softgym_mj.learning.methods.teacher_student import TeacherStudentSettings, make
from softgym_mj.learning.registry import find_method, find_preset
from softgym_mj.learning.results import Name, Reference, Row
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.tables import table
from softgym_mj.learning.training import Training
from softgym_mj.policies.exported import export_policy, observes
from softgym_mj.policies.planners import BUDGET, ITERATIONS
from tests.command import output_of
from tools import learned, published_commands, videos
from tools.queued_runs import QueuedRun

ABSTRACT = Name("straighten_rope", "default", "sac", "markov", "fast", "plain")
FRANKA = ABSTRACT._replace(actor="franka")


def _row(name, seed=0, score=0.5, env_steps=300):
    return Row(*name, seed, env_steps, 150, 60.0, "evaluate", 200, score, 1.0, True)


# ---------------------------------------------------------------------- presets


@pytest.mark.parametrize("task", ["straighten_rope", "fold_cloth"])
def test_an_arm_turns_symmetries_off_and_keeps_the_preset(task):
    training, method = find_preset("sac", "fast", task, actor="franka", observation="markov")
    assert (training.actor, method.preset) == ("franka", "fast")
    assert not (method.settings.symmetric or method.settings.symmetrize_policy)
    _, pickers = find_preset("sac", "fast", task, observation="markov")
    assert pickers.settings.symmetric
    without = {"symmetric": False, "symmetrize_policy": False}
    assert method.settings == dataclasses.replace(pickers.settings, **without)
    _, forced = find_preset("sac", "fast", task, actor="franka", symmetric=True)
    assert forced.settings.symmetric
    assert find_preset("sac", "fast", task, actor="franka", batch=64)[1].preset == "custom"


def test_the_default_actor_may_be_named():
    named = find_preset("sac", "fast", "straighten_rope", actor="picker")
    assert named == find_preset("sac", "fast", "straighten_rope")
    with pytest.raises(InvalidArgumentError, match="set this one by actor"):
        TrainingSettings("straighten_rope", arguments={"actor": "franka"})


def test_the_command_takes_the_actor_from_the_arguments_of_the_task():
    arguments = json.dumps({"actor": "franka", "action": "joints"})
    command = ["train", "sac", "fold_cloth", "--show-settings", "--task-settings", arguments]
    shown = json.loads(output_of(*command))
    assert (shown["actor"], shown["arguments"]) == ("franka", {"action": "joints"})
    assert shown["symmetric"] is shown["symmetrize_policy"] is False


def test_the_teacher_of_an_arm_learns_without_symmetries():
    small = {"random_steps": 16, "replay": 64}
    settings = TeacherStudentSettings(hidden=(8,), buffer=32, teacher_env_steps=128,
                                      teacher_settings=small)  # fmt: skip
    shapes = {"markov": (44,), "rgb": (35, 35, 3)}
    problem = Problem("straighten_rope", {"actor": "franka"}, [0], 16, (), 8, 1.0, "cpu", "rgb",
                      shapes, 256)  # fmt: skip
    assert not make(settings, problem).teacher._symmetries


# ---------------------------------------------------------------------- rows


def test_rows_of_arms_are_kept_apart(monkeypatch):
    rows = [_row(name, seed, score) for name, score in ((ABSTRACT, 0.9), (FRANKA, 0.6))
            for seed in range(3)]  # fmt: skip
    assert results.merged(rows) == rows
    known = Reference("straighten_rope", "sac", "markov", 300, 0.74, "is", "plot", "far")
    found = [(line["actor"], line["median"], line["published"]) for line in table(rows, [known])]
    assert found == [("default", 0.9, 0.74), ("franka", 0.6, None)]
    monkeypatch.setattr(learned, "rows", lambda: rows)
    monkeypatch.setattr(learned, "idle", lambda: {"straighten_rope": 0.5})
    assert learned.overview().splitlines()[2:4] == [
        "| `straighten_rope` | 0.50 | 0.90 (100%) SAC | | | | |",
        "| `straighten_rope`, `franka` | | 0.60 (100%) SAC | | | | |",
    ]
    assert [line.split(" | ")[0] for line in learned.results().splitlines()[2:4]] == [
        "| `straighten_rope`", "| `straighten_rope`, `franka`"
    ]  # fmt: skip
    earlier = [dataclasses.replace(row, env_steps=100, final=False) for row in rows]
    assert {*learned.curves([*rows, *earlier])} == {ABSTRACT, FRANKA}


def test_planners_with_arms_have_the_budget_of_the_paper():
    (rope,) = read_results([learned.RESULTS / "straighten_rope-cem.json"])
    planning = {"horizon": 15, "budget": BUDGET, "iterations": ITERATIONS, "replan_every": 1}
    arm = {**rope, "planning": planning, "settings": {"actor": "franka"}}
    (row,) = results.rows_of_planner(arm)
    assert (row.actor, row.preset) == ("franka", "paper")


# ---------------------------------------------------------------------- queue


def test_queued_runs_have_an_actor(monkeypatch):
    settings = {"observation": "markov"}
    run = QueuedRun("straighten_rope", "sac", "fast", 1, "", "franka", "markov", settings=settings,
                    gpu_minutes=1)  # fmt: skip
    assert """--task-settings '{"actor": "franka"}' --settings""" in run.command
    assert run.folder == "training/straighten_rope-franka-sac-markov-fast-plain-observation"
    assert run.is_done([_row(FRANKA)]) and not run.is_done([_row(ABSTRACT)])
    custom = FRANKA._replace(task="fold_cloth", preset="custom")
    shorter = dataclasses.replace(
        run, task="fold_cloth", settings={**settings, "env_steps": 409_600}
    )
    assert shorter.is_done([_row(custom, env_steps=409_600)])
    assert not shorter.is_done([_row(custom, env_steps=1_024_000)])
    planner = QueuedRun("straighten_rope", "cem", "paper", 1, "", "franka", gpu_minutes=1)
    assert "--episodes 200 --actor franka --device" in planner.command
    monkeypatch.setattr(published_commands, "read_queue", lambda file: [run])
    monkeypatch.setattr(learned, "rows", lambda: [_row(FRANKA)])
    (line,) = published_commands.commands().splitlines()[2:]
    assert line == f"| `straighten_rope`, `franka` | `{run.command}` |"
    monkeypatch.setattr(learned, "rows", lambda: [_row(ABSTRACT), _row(FRANKA)])
    with pytest.raises(InvalidArgumentError, match="of a run in queue"):
        published_commands.commands()


# ---------------------------------------------------------------------- policies


def test_published_policies_of_arms_are_found_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InvalidArgumentError,
        match="in a clone's folder the name of a file in docs/results/policies",
    ):
        policy_file("straighten_rope-franka-sac")
    file = tmp_path / PUBLISHED.format("straighten_rope-franka-sac")
    file.parent.mkdir(parents=True)
    file.touch()
    assert tmp_path / policy_file("straighten_rope-franka-sac") == file


@pytest.mark.long
def test_a_policy_plays_with_the_arm_of_its_training(tmp_path, monkeypatch):
    """Its file, evaluated by name alone, scores as the training's own last evaluation."""
    settings = TrainingSettings(
        "straighten_rope", "markov", env_steps=8, num_envs=2, part=8, episodes=1, final_episodes=1,
        actor="franka", episode_steps=2,
    )  # fmt: skip
    method = find_method("sac", hidden=(8,), random_steps=4, updates=2, batch=4, replay=16)
    training = Training(settings, method, [0], tmp_path, "cpu")
    training.run()
    rows = results.read_rows(tmp_path / "curve.csv")
    assert {(row.actor, row.replay) for row in rows} == {("franka", "plain")}
    file = tmp_path / "policy_0.pt2"
    assert observes(str(file)) == {"observation": "markov", "actor": "franka"}
    with pytest.raises(InvalidArgumentError, match=r"settings: actor='sawyer'.*'franka', with"):
        Configuration("straighten_rope", str(file), (800,), (0,), {"actor": "sawyer"})
    monkeypatch.chdir(tmp_path)
    published = tmp_path / PUBLISHED.format("straighten_rope-franka-sac")
    published.parent.mkdir(parents=True)
    published.write_bytes(file.read_bytes())
    command = ["evaluate", "straighten_rope", "--policy", "straighten_rope-franka-sac", "--trust",
               "--variations", "800", "--task-settings", '{"horizon": 2}']  # fmt: skip
    output_of(*command, "--out", str(tmp_path / "out"))
    (result,) = read_results([tmp_path / "out"])
    (row,) = (row for row in rows if row.split == "evaluate")
    assert result["settings"]["actor"] == "franka"
    assert result["summary"]["mean"] == pytest.approx(row.normalized_performance, abs=1e-3)
    teacher = {"teacher": PUBLISHED.format("straighten_rope-franka-sac"), "privileged": "markov"}
    assert cli._teacher("straighten_rope-franka-sac", True) == {**teacher, "actor": "franka"}
    monkeypatch.setattr(videos, "LEARNED", published.parent)
    assert videos.seen_by("straighten_rope-franka-sac")["actor"] == "franka"


class _Left(torch.nn.Module):
    """Teacher with one action for all states."""

    def forward(self, seen):
        return 0.0 * seen[:, :8] - 0.5


@pytest.mark.long
def test_a_student_of_external_cameras_imitates_its_teacher(tmp_path):
    file, names = tmp_path / "teacher.pt2", ["external_rgb", "proprioception", "held"]
    envs = softgym_mj.make_vec("straighten_rope", 1, observation="markov", actor="franka")
    spaces = {"markov": envs.single_observation_space}
    envs.close()
    file.write_bytes(export_policy(_Left(), spaces, {"observation": "markov", "actor": "franka"}))
    settings, method = find_preset(
        "distill", "fast", "straighten_rope", **cli._teacher(str(file), True), observation=names,
        env_steps=8, num_envs=2, part=8, updates=1, batch=4, buffer=16, hidden=[8], features=4,
        channels=4, image_size=[36, 36], episodes=1, final_episodes=1, episode_steps=2,
    )  # fmt: skip
    training = Training(settings, method, [0], tmp_path / "out", "host")
    training.run()
    (name,) = {row.name for row in results.read_rows(tmp_path / "out" / "curve.csv")}
    assert (name.actor, name.observation) == ("franka", "external_rgb+proprioception+held")
    batch = training.learner.frames.sample(0, 4)
    assert batch["external_rgb"].shape == (4, 2, 2, 36, 36, 3)  # Frames, cameras.
    torch.testing.assert_close(batch[LABEL], torch.full((4, 8), -0.5))
    note = observes(str(tmp_path / "out" / "policy_0.pt2"))
    assert note == {"observation": names, "image_size": [36, 36], "actor": "franka"}
