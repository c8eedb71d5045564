"""Time limits of trainings, by an invented clock; the oracle is the training without one."""

import csv
import dataclasses
import json

import pytest

from softgym_mj.learning.results import read_rows
from softgym_mj.learning.time_limits import OVERHEAD, TimeLimit
from softgym_mj.learning.training import Training
from tests.command import invoked, output_of
from tests.learning.test_training import METHOD, SEEDS, SETTINGS, result_of

# Evaluations have episodes of six env steps. Those of the final one are of two variations of two
# splits in two environments' time: 12 vector steps; those of an earlier one 6. Env steps and
# evaluations of the clock take:
STEP, UPDATE, EVALUATION = 2.0, 1.0, 32.0
FINAL, EARLIER = OVERHEAD + 12 * STEP, OVERHEAD + 6 * STEP


class _Clock:
    """Clock on which steps, updates and evaluations of a training take invented times."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def times(self, function, seconds):
        def timed(*args, **named):
            self.now += seconds
            return function(*args, **named)

        return timed


def _training(folder, end=None, settings=SETTINGS):
    clock = _Clock()
    limit = TimeLimit() if end is None else TimeLimit(end, clock)
    training = Training(settings, METHOD, SEEDS, folder, "host", limit=limit)
    training._explorer.step = clock.times(training._explorer.step, STEP)
    training.learner.learn = clock.times(training.learner.learn, UPDATE)
    training.play = clock.times(training.play, EVALUATION)
    return training


@pytest.mark.parametrize(
    "end, env_steps, curve",
    [
        (1.0, 2, [2]),  # A vector step is always made.
        (3 * (STEP + UPDATE) + OVERHEAD, 6, [6]),  # Three steps are an estimate.
        (5 * (STEP + UPDATE) + FINAL, 10, [10]),  # Within the second part.
        (8 * (STEP + UPDATE) + EARLIER + FINAL, 16, [16]),  # One evaluation at a part's end.
        (15 * (STEP + UPDATE) + EVALUATION + FINAL, 30, [16, 30]),
        (16 * (STEP + UPDATE) + EVALUATION + FINAL, 32, [16, 32]),
    ],
)
def test_a_training_ends_in_time(tmp_path, no_policies, end, env_steps, curve):
    training = _training(tmp_path, end)
    training.run()
    assert training.env_steps == training.end == env_steps
    written = read_rows(tmp_path / "curve.csv")
    assert sorted({row.env_steps for row in written}) == curve
    final = [row for row in written if row.final]
    assert {(row.env_steps, row.episodes) for row in final} == {(env_steps, 2)}
    assert len(final) == 2 * len(SEEDS)
    card = json.loads((tmp_path / "card.json").read_text())
    assert (card["evaluations"], card["env_steps"]) == (curve, env_steps)
    assert all((tmp_path / f"policy_{seed}.pt2").exists() for seed in SEEDS)
    with (tmp_path / "episodes.csv").open() as file:
        scores = [float(row["normalized_performance"]) for row in csv.DictReader(file)]
    held_out = [row.normalized_performance for row in final if row.split == "evaluate"]
    assert [(a + b) / 2 for a, b in zip(scores[::2], scores[1::2], strict=True)] == held_out


def test_the_result_is_that_of_a_training_of_the_env_steps_reached(tmp_path, no_policies):
    limited = _training(tmp_path / "limited", 12 * (STEP + UPDATE) + EVALUATION + FINAL)
    shorter = _training(tmp_path / "24", settings=dataclasses.replace(SETTINGS, env_steps=24))
    for training in (limited, shorter):
        training.run()
    assert result_of(limited) == result_of(shorter)


def test_several_limited_runs_are_one_training(tmp_path, no_policies):
    whole, reached = _training(tmp_path / "whole"), []
    whole.run()
    for _ in range(5):
        training = _training(tmp_path / "limited", 5 * (STEP + UPDATE) + FINAL)
        training.run()
        reached.append(training.env_steps)
    # There is time for five vector steps; not for the evaluation at 16 as well, which the next run
    # makes up for, and then three steps without an estimate.
    assert reached == [10, 16, 22, 32, 32]
    assert result_of(training) == result_of(whole)
    curve = read_rows(training.folder / "curve.csv")
    assert {row.env_steps for row in curve} == {16, 32}


def test_estimates_are_of_the_fastest_of_the_last_steps():
    clock = _Clock()
    limit = TimeLimit(100.0, clock)
    for seconds, free in ((50.0, 50.0), (3.0, 47.0), (2.0, 45.0)):
        assert not limit.is_over([])
        with limit.timed():
            clock.now += seconds
        assert clock.now == 100.0 - free
    # 45 s are left: 20 s and 12 steps of 2 s fit, 13 do not; nor do two evaluations of 3 steps.
    assert not limit.is_over([12.0]) and limit.is_over([12.5])
    assert not limit.is_over([1.0, 1.0]) and limit.is_over([1.0, 2.0])
    for _ in range(10):  # Slower steps of another phase.
        with limit.timed():
            clock.now += 2.5
    assert limit.is_over([0.0])
    assert not TimeLimit(clock=clock).is_over([1e9])


def test_the_command(tmp_path, no_policies):
    both = {**vars(SETTINGS), **vars(METHOD.settings), "env_steps": 16}
    settings = {name: value for name, value in both.items() if name != "task"}
    command = ["train", "sac", "straighten_rope", "--preset", "paper", "--device", "host"]
    command += ["--settings", json.dumps(settings), "--out", str(tmp_path)]
    done = output_of(*command, "--minutes", "0.01")
    assert "seed 0, evaluate, 2 episodes" in done
    assert "ended after 2 of 16 env steps: the same command continues" in done
    assert "ended after" not in output_of(*command)
    assert {row.env_steps for row in read_rows(tmp_path / "curve.csv")} == {16}
    for more in (["--minutes", "0"], ["--minutes", "9", "--jobs", "2"]):
        done = invoked(*command, *more)
        assert done.exit_code != 0 and "minutes=" in f"{done.output} {done.exception}"
