"""Evaluation: the protocol's numbers, interruptions, figures."""

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
from softgym_mj import cli, evaluation, plots
from softgym_mj.baselines.policies import make_policy
from softgym_mj.evaluation import Configuration, Planning, evaluate, summary
from softgym_mj.exceptions import OutOfRangeError, ResultError, UnknownNameError
from softgym_mj.workers import Processes, RayCluster

SHORT = {"horizon": 6}
PLANNING = Planning(horizon=3, budget=60, iterations=2, replan_every=2)
SIMPLE = Configuration("straighten_rope", "random", (800, 801, 802), (0, 1), SHORT)
PLANNED = Configuration("straighten_rope", "icem", (800, 801), (0,), SHORT, PLANNING)


def middle(env):
    """A policy for the tests: pulls the first picker up."""
    action = np.zeros(env.task.actor.action_size)
    action[2] = 0.5
    return lambda timestep: action


def test_the_summary_by_hand():
    scores = {0: (0.0, 0.4), 1: (0.6, 1.0), 2: (0.5, 0.5), 3: (-1.0, 0.0)}
    episodes = [
        {"seed": seed, "normalized_performance": score, "success": score > 0.9}
        for seed, pair in scores.items()
        for score in pair
    ]
    # Means of the seeds: 0.2, 0.8, 0.5, -0.5.
    expected = {"median": 0.35, "percentile_25": 0.025, "percentile_75": 0.575, "mean": 0.25,
                "min": -1.0, "max": 1.0, "success_rate": 0.125}  # fmt: skip
    assert summary(episodes) == pytest.approx(expected)


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


@pytest.mark.parametrize("configuration", [SIMPLE, PLANNED], ids=["random", "icem"])
def test_the_result_does_not_depend_on_the_workers(configuration, tmp_path):
    evaluate(configuration, tmp_path / "here")
    expected = (tmp_path / "here" / "result.json").read_bytes()
    with Processes(2) as workers:
        evaluate(configuration, tmp_path / "processes", workers)
    assert (tmp_path / "processes" / "result.json").read_bytes() == expected
    with RayCluster(number=2) as workers:
        evaluate(configuration, tmp_path / "ray", workers)
    assert (tmp_path / "ray" / "result.json").read_bytes() == expected


# Evaluates in a folder and says when an episode or a decision is there.
SCRIPT = """
import pathlib, sys
from softgym_mj.evaluation import Progress, evaluate
from tests import test_evaluation as module

say = lambda _: print("done", flush=True)
evaluate(getattr(module, sys.argv[1]), pathlib.Path(sys.argv[2]), None, Progress(say, say))
"""


def killed_after(name: str, folder: pathlib.Path, count: int) -> None:
    """Starts an evaluation and kills it when it has said `count` times that something is done."""
    root = str(pathlib.Path(softgym_mj.__file__).parents[1])
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, name, str(folder)],
        env={**os.environ, "PYTHONPATH": root},
        cwd=root,
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        for _ in range(count):
            assert process.stdout.readline() == "done\n"
        process.kill()
    assert process.returncode == -signal.SIGKILL


# Of a planned episode: three decisions, then the episode is there. A finished one is told again.
@pytest.mark.parametrize(
    ("name", "count", "left"), [("SIMPLE", 2, 6), ("PLANNED", 2, 6), ("PLANNED", 5, 4)]
)
def test_kill_and_resume(name, count, left, tmp_path):
    configuration = {"SIMPLE": SIMPLE, "PLANNED": PLANNED}[name]
    evaluate(configuration, tmp_path / "whole")
    killed_after(name, tmp_path / "killed", count)
    assert not (tmp_path / "killed" / "result.json").exists()
    (tmp_path / "killed" / "episodes").mkdir(exist_ok=True)
    done = {f: f.stat().st_mtime_ns for f in (tmp_path / "killed" / "episodes").glob("*.json")}
    told = []
    evaluate(
        configuration, tmp_path / "killed", None, evaluation.Progress(told.append, told.append)
    )
    assert (tmp_path / "killed" / "result.json").read_bytes() == (
        tmp_path / "whole" / "result.json"
    ).read_bytes()
    assert all(file.stat().st_mtime_ns == then for file, then in done.items())
    assert len(told) == left


def deadly(env):
    """`middle`, but the first process that gets to the third step of variation 801 is killed."""
    act, flag = middle(env), pathlib.Path(os.environ["DEADLY_FLAG"])

    def policy(timestep):
        if env.task.variation == 801 and env.step_count == 2 and not flag.exists():
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return act(timestep)

    return policy


@pytest.mark.parametrize("kind", ["processes", "ray"])
def test_a_worker_that_is_killed_costs_nothing(kind, tmp_path, monkeypatch):
    flag = tmp_path / "killed"
    monkeypatch.setenv("DEADLY_FLAG", str(flag))
    configuration = Configuration(
        "straighten_rope", "tests.test_evaluation:deadly", (800, 801, 802), (0, 1), SHORT
    )
    with Processes(2) if kind == "processes" else RayCluster(number=2) as workers:
        evaluate(configuration, tmp_path / "killed_once", workers)
    assert flag.exists()
    evaluate(configuration, tmp_path / "whole")
    assert (tmp_path / "killed_once" / "result.json").read_bytes() == (
        tmp_path / "whole" / "result.json"
    ).read_bytes()


def test_a_folder_belongs_to_one_configuration(tmp_path):
    evaluate(SIMPLE, tmp_path)
    other = Configuration("straighten_rope", "zero", (800, 801, 802), (0, 1), SHORT)
    with pytest.raises(ResultError, match="another policy"):
        evaluate(other, tmp_path)
    file = next((tmp_path / "episodes").glob("*.json"))
    file.write_text("{")
    with pytest.raises(ResultError, match="cannot be read"):
        evaluate(SIMPLE, tmp_path)


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"policy": "best"}, UnknownNameError, r"policy='best'.*'scripted'.*'icem'"),
        ({"task": "fly"}, UnknownNameError, "task='fly'"),
        ({"variations": ()}, OutOfRangeError, "number of variations=0"),
        ({"variations": (1000,)}, OutOfRangeError, "variation=1000"),
        ({"policy": "cem", "planning": Planning(budget=100)}, OutOfRangeError, "budget=100"),
        ({"policy": "cem", "planning": Planning(replan_every=16)}, OutOfRangeError, "replan_every"),
        ({"policy": "zero", "planning": Planning()}, ResultError, "not for 'zero'"),
    ],
)
def test_bad_configurations(settings, error, message):
    valid = {"task": "straighten_rope", "policy": "zero", "variations": (800,)}
    with pytest.raises(error, match=message):
        Configuration(**{**valid, **settings})


# ---------------------------------------------------------------- figures


def written(folder, **changes):
    """A result file with some of its entries changed."""
    folder.mkdir()
    result = evaluate(Configuration("straighten_rope", "zero", (800, 801), (0,), SHORT), folder)
    evaluation.write_json(folder / "result.json", {**result, **changes})
    return folder


def test_figures_are_drawn_from_results(tmp_path):
    import imageio.v3 as imageio

    results = [
        written(tmp_path / "zero"),
        written(tmp_path / "long", policy="cem", planning={"horizon": 15, "budget": 1}),
        written(tmp_path / "short", policy="cem", planning={"horizon": 5, "budget": 1}),
    ]
    read = plots.read_results(results)
    assert plots.labels(read) == ["zero", "cem horizon=15", "cem horizon=5"]
    scores = [e["normalized_performance"] for e in read[0]["episodes"]]
    assert plots.spread(read[0]) == pytest.approx(
        (np.mean(scores), *(min(scores) + np.array([0.25, 0.75]) * np.ptp(scores)))
    )
    output = CliRunner().invoke(
        cli.app, ["plot", *map(str, results), "--out", str(tmp_path / "bars.png")]
    )
    assert output.exit_code == 0, output.output
    assert "cem horizon=15" in output.output.replace("\n", " ")
    plots.curves(read[1:], "horizon", tmp_path / "curves.png")
    for name in ("bars.png", "curves.png"):
        picture = imageio.imread(tmp_path / name)
        assert picture.shape[0] > 300 and len(np.unique(picture[..., 0])) > 20
    with pytest.raises(ResultError, match="does not plan"):
        plots.curves(read, "horizon", tmp_path / "x.png")
    with pytest.raises(UnknownNameError, match="x='colour'"):
        plots.curves(read, "colour", tmp_path / "x.png")


def test_results_of_other_protocols_are_not_mixed(tmp_path):
    results = [written(tmp_path / "new"), written(tmp_path / "old", protocol=0)]
    with pytest.raises(ResultError, match=r"protocol versions \[0, 1\]"):
        plots.read_results(results)
    (tmp_path / "x.json").write_text("{}")
    with pytest.raises(ResultError, match="not the result of an evaluation"):
        plots.read_results([tmp_path / "x.json"])
    with pytest.raises(ResultError, match="cannot be read"):
        plots.read_results([tmp_path / "nothing.json"])
    with pytest.raises(ResultError, match="no results"):
        plots.read_results([])


def test_the_command_line_evaluates(tmp_path, monkeypatch):
    arguments = ["evaluate", "straighten_rope", "--policy", "cem", "--horizon", "3", "--budget"]
    arguments += ["60", "--iterations", "2", "--replan-every", "3", "--episodes", "1"]
    arguments += ["--settings", '{"horizon": 6}', "--out", str(tmp_path / "run")]
    output = CliRunner().invoke(cli.app, arguments)
    assert output.exit_code == 0, output.output
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["planning"] == {"horizon": 3, "budget": 60, "iterations": 2, "replan_every": 3}

    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluation, "evaluate", interrupt)
    stopped = CliRunner().invoke(cli.app, arguments)
    assert stopped.exit_code == 130 and "the same command goes on" in stopped.output
    failed = CliRunner().invoke(cli.app, ["evaluate", "straighten_rope", "--settings", "[1]"])
    assert isinstance(failed.exception, OutOfRangeError)
    assert "settings='[1]'" in str(failed.exception)
