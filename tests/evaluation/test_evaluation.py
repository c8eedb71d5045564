"""Evaluation: what is scored, by whom, and what interruptions cost."""

import json
import os
import pathlib
import signal
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import softgym_mj
from softgym_mj import evaluation
from softgym_mj.cli import commands
from softgym_mj.evaluation import Configuration, Planning, evaluate
from softgym_mj.evaluation.machine import machine
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.jobs.executors import ProcessExecutor, RayExecutor
from softgym_mj.policies.factory import make_policy

SHORT = {"horizon": 6}
PLANNING = Planning(horizon=3, budget=60, iterations=2, replan_every=2)
SIMPLE = Configuration("straighten_rope", "random", (800, 801, 802), (0, 1), SHORT)
PLANNED = Configuration("straighten_rope", "icem", (800, 801), (0,), SHORT, PLANNING)


def constant(env, seed):
    """A policy for the tests: pulls the first picker up, faster with larger seeds."""
    action = np.zeros(env.task.actor.action_size)
    action[2] = (seed + 1) / 10
    return lambda timestep: action


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


def test_the_result_does_not_depend_on_the_executor(tmp_path):
    configurations = {"random": SIMPLE, "icem": PLANNED}
    expected = {}
    for name, configuration in configurations.items():
        evaluate(configuration, tmp_path / "here" / name)
        expected[name] = (tmp_path / "here" / name / "result.json").read_bytes()
    # Both with the same workers, whose start takes longer than what they do.
    for kind in (ProcessExecutor, RayExecutor):
        with kind(number=2) as executor:
            for name, configuration in configurations.items():
                evaluate(configuration, tmp_path / kind.__name__ / name, executor)
                result = tmp_path / kind.__name__ / name / "result.json"
                assert result.read_bytes() == expected[name]


# Evaluates in a folder and says when an episode or a decision is there.
SCRIPT = """
import pathlib, sys
from softgym_mj.evaluation import Progress, evaluate
from tests.evaluation import test_evaluation as module

say = lambda _: print("done", flush=True)
evaluate(module.PLANNED, pathlib.Path(sys.argv[1]), None, Progress(say, say))
"""


def killed_after(folder: pathlib.Path, count: int) -> None:
    """Starts an evaluation and kills it when it has said `count` times that something is done."""
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, str(folder)],
        cwd=pathlib.Path(__file__).parents[2],  # Where it finds the tests.
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        for _ in range(count):
            assert process.stdout.readline() == "done\n"
        process.kill()
    assert process.returncode == -signal.SIGKILL


# Of a planned episode: three decisions, then the episode is there. A finished one is told again.
@pytest.mark.parametrize(("count", "left"), [(2, 6), (5, 4)])
def test_an_episode_goes_on_from_its_plans(count, left, tmp_path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    evaluate(PLANNED, whole)
    killed_after(killed, count)
    assert not (killed / "result.json").exists()
    told = []
    evaluate(PLANNED, killed, None, evaluation.Progress(told.append, told.append))
    assert (killed / "result.json").read_bytes() == (whole / "result.json").read_bytes()
    assert len(told) == left


def deadly(env, seed):
    """`constant`, but the first process that gets to the third step of variation 801 is killed."""
    act, flag = constant(env, seed), pathlib.Path(os.environ["DEADLY_FLAG"])

    def policy(timestep):
        if env.task.variation == 801 and env.step_count == 2 and not flag.exists():
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return act(timestep)

    return policy


def test_a_worker_that_is_killed_costs_nothing(tmp_path, monkeypatch):
    flag = tmp_path / "killed"
    monkeypatch.setenv("DEADLY_FLAG", str(flag))
    configuration = Configuration(
        "straighten_rope", "tests.evaluation.test_evaluation:deadly", (800, 801, 802), (0, 1), SHORT
    )
    with ProcessExecutor(2) as executor:
        evaluate(configuration, tmp_path / "killed_once", executor)
    assert flag.exists()
    evaluate(configuration, tmp_path / "whole")
    assert (tmp_path / "killed_once" / "result.json").read_bytes() == (
        tmp_path / "whole" / "result.json"
    ).read_bytes()


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


def test_the_machine_says_which_processor_it_has():
    assert set(machine()) == {"cpu"}


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"policy": "best"}, InvalidArgumentError, r"policy='best'.*'scripted'.*'icem'"),
        ({"task": "fly"}, InvalidArgumentError, "task='fly'"),
        ({"variations": ()}, InvalidArgumentError, "number of variations=0"),
        ({"variations": (1000,)}, InvalidArgumentError, "variation=1000"),
        ({"variations": (800, 801, 800)}, InvalidArgumentError, "each of them once"),
        (
            {"seeds": (0, 1)},
            InvalidArgumentError,
            "seeds=2.*1, as 'zero' is the same policy for every",
        ),
        (
            {"policy": "run.pt2", "seeds": (0, 1)},
            InvalidArgumentError,
            r"seeds=2.*FILE\{seed\}\.pt2",
        ),
        ({"settings": {"split": "train"}}, InvalidArgumentError, "settings=.*not 'split'"),
        ({"policy": "cem", "planning": Planning(budget=100)}, InvalidArgumentError, "budget=100"),
        (
            {"policy": "cem", "planning": Planning(replan_every=16)},
            InvalidArgumentError,
            "replan_every",
        ),
        ({"policy": "zero", "planning": Planning()}, StoreError, "not for 'zero'"),
    ],
)
def test_bad_configurations(settings, error, message):
    valid = {"task": "straighten_rope", "policy": "zero", "variations": (800,)}
    with pytest.raises(error, match=message):
        Configuration(**{**valid, **settings})


def test_the_command_line_evaluates(tmp_path, monkeypatch):
    arguments = ["evaluate", "straighten_rope", "--policy", "cem", "--horizon", "3", "--budget"]
    arguments += ["60", "--iterations", "2", "--replan-every", "3", "--episodes", "1"]
    arguments += ["--settings", '{"horizon": 6}', "--out", str(tmp_path / "run")]
    output = CliRunner().invoke(commands.app, arguments)
    assert output.exit_code == 0, output.output
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["planning"] == {"horizon": 3, "budget": 60, "iterations": 2, "replan_every": 3}

    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, "evaluate", interrupt)
    stopped = CliRunner().invoke(commands.app, arguments)
    assert stopped.exit_code == 130 and "the same command goes on" in stopped.output
    failed = CliRunner().invoke(commands.app, ["evaluate", "straighten_rope", "--settings", "[1]"])
    assert isinstance(failed.exception, InvalidArgumentError)
    assert "settings='[1]'" in str(failed.exception)


def test_the_command_line_chooses_variations_and_actors(tmp_path):
    base = ["evaluate", "straighten_rope", "--policy", "zero", "--settings", '{"horizon": 1}']
    chosen = {
        ("--variations", "3,810-811"): [3, 810, 811],
        ("--split", "train", "--episodes", "2"): [0, 1],
        ("--episodes", "2"): [800, 801],
    }
    for number, (options, variations) in enumerate(chosen.items()):
        folder = tmp_path / str(number)
        arguments = [*base, *options, "--actor", "pick_and_place", "--out", str(folder)]
        output = CliRunner().invoke(commands.app, arguments)
        assert output.exit_code == 0, output.output
        assert "median over variations" in output.output.replace("\n", " ")
        result = json.loads((folder / "result.json").read_text())
        assert result["variations"] == variations
        assert result["settings"] == {"horizon": 1, "actor": "pick_and_place"}
    failed = CliRunner().invoke(commands.app, [*base, "--variations", "3", "--episodes", "2"])
    assert isinstance(failed.exception, InvalidArgumentError)


def test_workers_find_policies_of_the_current_folder(tmp_path):
    (tmp_path / "own.py").write_text(
        "import pathlib\n\n\ndef make(env, seed):\n    pathlib.Path(f'{seed}').touch()\n"
        "    return lambda timestep: [0.0] * 8\n"
    )
    command = [pathlib.Path(sys.executable).with_name("softgym-mj"), "evaluate", "straighten_rope"]
    command += ["--policy", "own:make", "--seeds", "2", "--episodes", "1", "--jobs", "2"]
    command += ["--settings", '{"horizon": 1}']
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    assert (tmp_path / "0").exists() and (tmp_path / "1").exists()
