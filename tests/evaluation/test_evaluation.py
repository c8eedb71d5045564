"""Evaluation: what is scored, by whom, and what interruptions cost."""

import dataclasses
import json
import pathlib
import signal
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj import evaluation
from softgym_mj.cli import evaluation as cli_evaluation
from softgym_mj.evaluation import Configuration, Planning, evaluate, running
from softgym_mj.exceptions import InvalidArgumentError, StoreError, UnavailableError
from softgym_mj.parallel.executors import ProcessExecutor, RayExecutor
from softgym_mj.policies.exported import export_policy
from softgym_mj.policies.factory import make_policy
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.vector.batch.backend import BatchBackend
from tests.command import error_of, invoked, output_of

SHORT = {"horizon": 6, "fidelity": "fast"}
PLANNING = Planning(horizon=3, budget=60, iterations=2, replan_every=2)
SIMPLE = Configuration("straighten_rope", "random", (800, 801, 802), (0, 1), SHORT)
PLANNED = Configuration("straighten_rope", "icem", (800, 801), (0,), SHORT, PLANNING)


@pytest.fixture(name="planned", scope="module")
def _planned(tmp_path_factory):
    """Where `PLANNED` has been played from beginning to end."""
    folder = tmp_path_factory.mktemp("planned")
    evaluate(PLANNED, folder)
    return folder


def test_an_episode_is_scored_at_its_last_step(tmp_path):
    result = evaluate(SIMPLE, tmp_path)
    assert [(e["variation"], e["seed"]) for e in result["episodes"]] == SIMPLE.episodes
    env = softgym_mj.load("straighten_rope", split="all", **SHORT)
    for episode in (result["episodes"][1], result["episodes"][4]):
        policy = make_policy("random", env, episode["seed"])
        timestep, total = env.reset(episode["variation"]), 0.0
        while not timestep.last():
            timestep = env.step(policy(timestep))
            total += timestep.reward
        assert episode["normalized_performance"] == env.info()["normalized_performance"]
        assert episode["return"] == total
    # Variations differ, and seeds where the rope was touched.
    assert len({e["return"] for e in result["episodes"]}) >= 5
    assert result["protocol"] == evaluation.PROTOCOL
    assert result["versions"]["softgym_mj"] == softgym_mj.__version__
    assert json.loads((tmp_path / "result.json").read_text()) == result


@pytest.mark.parametrize(
    "kind", [ProcessExecutor, pytest.param(RayExecutor, marks=pytest.mark.slow)]
)
def test_the_result_does_not_depend_on_the_executor(kind, tmp_path, planned):
    # Both with the same workers, whose start takes longer than what they do.
    with kind(number=2) as executor:
        evaluate(SIMPLE, tmp_path / "here")
        for configuration, here in ((SIMPLE, tmp_path / "here"), (PLANNED, planned)):
            there = tmp_path / configuration.policy
            evaluate(configuration, there, executor)
            assert (there / "result.json").read_bytes() == (here / "result.json").read_bytes()


# Evaluates in a folder and says when an episode or a decision is there.
SCRIPT = """
import pathlib, sys
from softgym_mj.evaluation import Progress, evaluate
from tests.evaluation import test_evaluation as module

say = lambda _: print("done", flush=True)
evaluate(module.PLANNED, pathlib.Path(sys.argv[1]), None, Progress(say, say))
"""


def test_an_episode_goes_on_from_its_plans(tmp_path, planned):
    killed = tmp_path / "killed"
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(killed)],
        cwd=pathlib.Path(__file__).parents[2],  # Where it finds the tests.
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        for _ in range(5):  # Three decisions, an episode, and a decision of the next one.
            assert process.stdout.readline() == "done\n"
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert not (killed / "result.json").exists()
    calls = []
    evaluate(PLANNED, killed, None, evaluation.Progress(calls.append, calls.append))
    assert (killed / "result.json").read_bytes() == (planned / "result.json").read_bytes()
    assert len(calls) == 4  # The finished episode, two decisions, and the other one.


def brightness(env):
    """A policy that needs images: its actions are how bright they are."""
    return lambda timestep: np.full(8, timestep.observation["rgb"].mean() / 255)


def test_a_policy_sees_the_observation_of_the_settings(tmp_path):
    settings = {**SHORT, "observation": "rgb", "image_size": (16, 16)}
    configuration = Configuration("straighten_rope", f"{__name__}:brightness", (5,), (0,), settings)
    result = evaluate(configuration, tmp_path)
    env = softgym_mj.load("straighten_rope", split="all", **settings)
    act, timestep, total = brightness(env), env.reset(5), 0.0
    while not timestep.last():
        timestep = env.step(act(timestep))
        total += timestep.reward
    assert result["episodes"][0]["return"] == total
    assert evaluate(configuration, tmp_path) == result


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"policy": "best"}, r"policy='best'.*'scripted'.*'icem'"),
        ({"task": "fly"}, "task='fly'"),
        ({"variations": ()}, "number of variations=0"),
        ({"variations": (1000,)}, "variation=1000"),
        ({"variations": (800, 801, 800)}, "distinct values"),
        ({"seeds": (0, 1)}, "seeds=2.*1, as 'zero' is the same policy for every"),
        ({"policy": "run.pt2", "seeds": (0, 1)}, r"seeds=2.*FILE\{seed\}\.pt2"),
        ({"settings": {"split": "train"}}, "settings=.*not 'split'"),
        ({"policy": "cem", "planning": Planning(budget=100)}, "budget=100"),
        ({"policy": "cem", "planning": Planning(replan_every=16)}, "replan_every"),
    ],
)
def test_bad_configurations(settings, message):
    valid = {"task": "straighten_rope", "policy": "zero", "variations": (800,)}
    with pytest.raises(InvalidArgumentError, match=message):
        Configuration(**{**valid, **settings})
    with pytest.raises(InvalidArgumentError, match="not for 'zero'"):
        Configuration(**valid, planning=Planning())


def test_planners_try_actions_on_a_device(tmp_path, planned):
    here = json.loads((planned / "result.json").read_text())
    output = [here, evaluate(PLANNED, tmp_path, device="host")]
    scores = [
        [episode["normalized_performance"] for episode in result["episodes"]] for result in output
    ]
    assert scores[0] == pytest.approx(scores[1], abs=1e-9)


# Cloths of different sizes, six decisions.
LOCKSTEP = Configuration(
    "fold_cloth", "cem", (800, 801, 802), (0,), {"horizon": 2, "fidelity": "fast"},
    Planning(horizon=2, budget=40, iterations=2),
)  # fmt: skip


def kept(folder):
    """The result and all plans, as bytes by the names of their files."""
    files = [folder / "result.json", *folder.rglob("*.jsonl")]
    return {file.name: file.read_bytes() for file in files}


@pytest.fixture(name="lockstep", scope="module")
def _lockstep(tmp_path_factory):
    """Where these episodes have been played together."""
    folder = tmp_path_factory.mktemp("lockstep")
    with pytest.MonkeyPatch.context() as patch:
        replayed = _replayed(patch)
        evaluate(LOCKSTEP, folder, device="host")
    assert replayed == 4 * [3]  # In each of two iterations of two decisions.
    assert len(kept(folder)) == 4
    return folder


def _replayed(patch):
    """Filled with how many episodes are tried at once, each time."""
    result, replay = [], BatchBackend.replay
    patch.setattr(
        BatchBackend, "replay", lambda *args: (result.append(len(args[1])), replay(*args))[1]
    )
    return result


@pytest.mark.long
def test_episodes_are_planned_together_as_alone(tmp_path, lockstep, monkeypatch):
    replayed = _replayed(monkeypatch)
    monkeypatch.setattr(running, "MOST_ENVS", 20)
    evaluate(LOCKSTEP, tmp_path, device="host")
    assert replayed == 4 * [2] + 4 * [1]
    assert kept(tmp_path) == kept(lockstep)


# All three together; one after the other where there is room for less than one.
@pytest.mark.long
@pytest.mark.parametrize("num_envs", [30, 5])
def test_episodes_together_go_on_from_their_plans(tmp_path, lockstep, num_envs, monkeypatch):
    random, calls = np.random.default_rng(num_envs), []

    def interrupt(plan):
        calls.append(plan)
        if len(calls) == last:
            raise KeyboardInterrupt

    monkeypatch.setattr(running, "MOST_ENVS", num_envs)
    last = int(random.integers(3, 5))  # Alone: in the second episode.
    with pytest.raises(KeyboardInterrupt):
        evaluate(
            LOCKSTEP, tmp_path, None, evaluation.Progress(on_decision=interrupt), device="host"
        )
    monkeypatch.undo()
    calls.clear()
    before, last = last, None
    evaluate(LOCKSTEP, tmp_path, None, evaluation.Progress(on_decision=interrupt), device="host")
    assert len(calls) == 6 - before
    assert kept(tmp_path) == kept(lockstep)


@pytest.mark.parametrize("policy", ["random", "zero"])
def test_episodes_side_by_side_are_those_of_one_after_the_other(tmp_path, policy):
    seeds = (0, 1) if policy == "random" else (0,)
    configuration = dataclasses.replace(SIMPLE, policy=policy, seeds=seeds)
    output = [evaluate(configuration, tmp_path / name, device=name) for name in ("cpu", "host")]
    for ours, theirs in zip(*(result["episodes"] for result in output), strict=True):
        assert (
            ours.keys() == theirs.keys()
            and ours["secondary_metrics"].keys() == theirs["secondary_metrics"].keys()
        )
        for name in ("variation", "seed", "success"):
            assert ours[name] == theirs[name]
        for name in ("normalized_performance", "performance", "return"):
            assert theirs[name] == pytest.approx(ours[name], abs=1e-12)
        assert theirs["secondary_metrics"] == pytest.approx(ours["secondary_metrics"], abs=1e-12)
    assert evaluate(configuration, tmp_path / "host", device="cpu") == output[1]  # It is all there.


def test_a_folder_has_episodes_of_one_renderer(tmp_path):
    settings = {**SHORT, "observation": "rgb", "image_size": [16, 16]}
    configuration = dataclasses.replace(SIMPLE, policy="zero", seeds=(0,), settings=settings)
    result = evaluate(configuration, tmp_path)
    assert evaluate(configuration, tmp_path) == result and result["renderer"] == "OpenGL"
    with pytest.raises(StoreError, match="different renderer"):
        evaluate(configuration, tmp_path, device="host")


def test_images_of_a_device_need_no_opengl(tmp_path, monkeypatch):
    def refuse(*arguments):
        raise UnavailableError("there is no OpenGL")

    configuration = dataclasses.replace(SIMPLE, policy="zero", seeds=(0,))
    expected = evaluate(configuration, tmp_path / "states", device="host")
    settings = {**SHORT, "observation": "rgb", "image_size": [16, 16]}
    seeing = dataclasses.replace(configuration, settings=settings)
    monkeypatch.setattr(CameraView, "_render", refuse)
    assert evaluate(seeing, tmp_path / "images", device="host")["episodes"] == expected["episodes"]


@pytest.mark.parametrize("names_its_observation", [False, True])
def test_saved_policies_act_side_by_side(tmp_path, names_its_observation):
    import torch  # Here: the other tests start processes that import this module.

    torch.manual_seed(0)
    module = torch.nn.Sequential(torch.nn.Linear(36, 8), torch.nn.Tanh())
    file = tmp_path / "policy.pt2"
    if names_its_observation:  # As the files of `softgym-mj train` do.
        space = gymnasium.spaces.Box(-np.inf, np.inf, (36,), np.float32)
        observed = {"observation": "reduced"}
        file.write_bytes(export_policy(module, {"reduced": space}, observed))
    else:
        torch.export.save(torch.export.export(module, (torch.zeros(1, 36),)), file)
    configuration = dataclasses.replace(SIMPLE, policy=str(file), seeds=(0,))
    output = [
        evaluate(configuration, tmp_path / name, device=name, trust=True)
        for name in ("cpu", "host")
    ]
    scores = [[e["return"] for e in result["episodes"]] for result in output]
    assert scores[0] == pytest.approx(scores[1], abs=1e-12) and len(set(scores[0])) == 3


def test_what_looks_at_a_simulation_is_refused_on_devices(tmp_path):
    configuration = dataclasses.replace(SIMPLE, policy="scripted", seeds=(0,))
    with pytest.raises(InvalidArgumentError, match=r"device.*'cpu' for 'scripted'"):
        evaluate(configuration, tmp_path, device="host")


def test_the_command_line_evaluates(tmp_path, monkeypatch):
    arguments = ["evaluate", "straighten_rope", "--policy", "cem", "--horizon", "3", "--budget"]
    arguments += ["60", "--iterations", "2", "--replan-every", "3", "--episodes", "1"]
    arguments += ["--task-settings", '{"horizon": 6}', "--out", str(tmp_path / "run")]
    output_of(*arguments)
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["planning"] == {"horizon": 3, "budget": 60, "iterations": 2, "replan_every": 3}

    def interrupt(*arguments, **settings):
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, "evaluate", interrupt)
    stopped = invoked(*arguments)
    assert stopped.exit_code == 130 and "the same command continues" in stopped.output
    error = error_of(*arguments[:2], "--task-settings", "[1]")
    assert isinstance(error, InvalidArgumentError) and "task_settings='[1]'" in str(error)


def test_the_command_line_chooses_variations_and_actors(tmp_path):
    base = ["evaluate", "straighten_rope", "--policy", "zero", "--task-settings", '{"horizon": 1}']
    chosen = {
        ("--variations", "3,810-811"): [3, 810, 811],
        ("--split", "train", "--episodes", "2"): [0, 1],
        ("--episodes", "2"): [800, 801],
    }
    for number, (options, variations) in enumerate(chosen.items()):
        folder = tmp_path / str(number)
        arguments = [*base, *options, "--actor", "picker", "--out", str(folder)]
        assert "median over variations" in output_of(*arguments).replace("\n", " ")
        result = json.loads((folder / "result.json").read_text())
        assert result["variations"] == variations
        assert result["settings"] == {"horizon": 1, "actor": "picker"}
    for options, words in {
        ("--variations", "3", "--episodes", "2"): "--variations cannot be combined with --episodes",
        ("--horizon", "5"): (
            "planning is for cem, icem, not for 'zero': leave out horizon, budget, iterations, "
            "replan_every"
        ),
        ("--task-settings", '{"actor": "ur5e"}', "--actor", "franka"): (
            "task_settings: actor='ur5e' is not valid: expected 'franka', the value of --actor"
        ),
    }.items():
        error = error_of(*base, *options, "--out", tmp_path / "refused")
        assert isinstance(error, InvalidArgumentError) and words in str(error)


@pytest.mark.parametrize(
    "settings", [{}, {"actor": "pick_and_place"}, {"horizon": 6, "actor": "pick_and_place"}]
)
def test_the_bar_counts_the_decisions_of_the_environment(settings, monkeypatch):
    bars, make = [], cli_evaluation.progress_bar
    monkeypatch.setattr(
        cli_evaluation, "progress_bar", lambda *own: bars.append(make(*own)) or bars[-1]
    )
    configuration = dataclasses.replace(PLANNED, settings=settings)
    with cli_evaluation.progress_of(configuration):
        pass
    decisions = -(-softgym_mj.load("straighten_rope", **settings).horizon // 2)
    assert bars[0].tasks[0].total == decisions * len(configuration.episodes)


def test_a_batch_reports_its_env_steps(tmp_path):
    steps = []
    settings = {"horizon": 3, "fidelity": "fast"}
    configuration = Configuration("straighten_rope", "zero", (800, 801), settings=settings)
    progress = evaluation.Progress(on_step=steps.append)
    evaluate(configuration, tmp_path, None, progress, device="host")
    assert steps == [0, 1, 2]
