"""What the training script relies on: its rewards, and the symmetries of the task."""

import itertools
import json
import pathlib
import re

import gymnasium
import numpy as np
import pytest

from benchmarks import sac
from softgym_mj.tasks.straighten_rope import StraightenRope

DOCS = pathlib.Path(__file__).parents[2] / "docs"
VARIATION = 803
ALIKE = 2e-4  # [m] How alike a step is in a mirror: rows are solved in another order there.


@pytest.fixture(name="env", scope="module")
def _env():
    return gymnasium.make(sac.TASK, split="all")


def ways():
    """All 32 ways to see the task: of a vector in the plane, of the rope, of the pickers."""
    numbers = (-1.0, 1.0)
    for x, y, diagonal, reverse, exchange in itertools.product(numbers, numbers, *[(0, 1)] * 3):
        turn = np.diag([x, y, 1.0])
        yield turn[[1, 0, 2]] if diagonal else turn, 1 - 2 * reverse, 1 - 2 * exchange


def test_a_step_is_the_same_in_every_way_it_is_sampled(env):
    """Every sample is what the simulation does in a scene turned and numbered like that."""
    dm_env = env.unwrapped.dm_env
    env.reset(options={"variation": VARIATION})
    start = dm_env.task.rope.points().copy()
    # One picker holds an end and pulls it; the other one pushes its way down.
    pickers = np.array([start[0] + [0.0, 0.01, 0.03], [0.05, -0.04, 0.1]])
    actions = np.array([[0.3, -0.2, 0.1, 1.0], [-0.5, 0.25, -0.9, -1.0]])
    steps = []
    for turn, reverse, exchange in ways():
        observation, _ = env.reset(options={"variation": VARIATION})
        dm_env.task.rope.set_points((start @ turn.T)[::reverse])
        dm_env.task.actor.place((pickers @ turn.T)[::exchange], StraightenRope.workspace)
        action = np.hstack([actions[:, :3] @ turn.T, actions[:, 3:]])[::exchange].ravel()
        before = dm_env.task.observe("reduced").ravel()
        observation, *_ = env.step(action)
        assert (dm_env.task.actor.held >= 0).sum() == 1
        steps.append(np.concatenate([before, action, observation]))
    steps = np.array(steps)
    buffer = sac.SymmetricBuffer(1, env.observation_space, env.action_space, device="cpu")
    buffer.add(steps[0, :36], steps[0, 44:], steps[0, 36:44], np.zeros(1), np.zeros(1), [{}])
    samples = buffer.sample(500)
    seen = np.hstack([samples.observations, samples.actions, samples.next_observations])
    errors = np.abs(seen[:, None] - steps).max(axis=-1)
    assert errors.min(axis=1).max() < ALIKE
    assert set(errors.argmin(axis=1)) == set(range(32))


def approach(observation) -> float:
    """Mean distance of the pickers from the ends, each from its own [m]."""
    points = observation.reshape(12, 3)
    return min(
        np.mean([np.linalg.norm(points[end] - points[picker]) for end, picker in pairs])
        for pairs in (((0, 10), (9, 11)), ((0, 11), (9, 10)))
    )


def test_rewards_add_up_to_the_progress(env):
    progress = sac.Progress(env)
    observation, first = progress.reset(options={"variation": VARIATION})
    start, total = approach(observation), 0.0
    progress.action_space.seed(1)
    for _ in range(20):
        observation, reward, *_, last = progress.step(progress.action_space.sample())
        total += reward
    gain = last["normalized_performance"] - first["normalized_performance"]
    nearer = start - approach(observation)
    assert abs(gain) > 0.01 and abs(nearer) > 0.01
    assert total == pytest.approx(sac.REWARD_SCALE * (gain + sac.APPROACH * nearer), rel=1e-5)


def test_the_page_says_what_was_measured():
    results = json.loads((DOCS / "sac.json").read_text())
    page = (DOCS / "recipes.md").read_text()
    rows = re.findall(r"^\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", page, re.MULTILINE)
    assert len(results) == len(rows) >= 2
    for result, row in zip(results, rows, strict=True):
        final = result["curve"]["20000"]
        measured = [np.mean(result["random"]), np.mean(final), min(final)]
        assert row == (str(result["seed"]), *(f"{value:.2f}" for value in measured))
