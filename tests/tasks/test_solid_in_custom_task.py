"""A solid in a task of one's own: the example of docs/custom_tasks.md, by pickers and by arms."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.factory import make_policy
from tests.custom_tasks import defined_with


@pytest.fixture(scope="module")
def page():
    """Returns what the page's code defines."""
    return defined_with("HangTowel")


def played(page, actor, variation):
    """The environment after an episode of the task's expert."""
    task = page["HangTowel"](actor=actor)
    env = Environment(task, name="hang_towel", horizon=task.horizon, split="all")
    for _ in env.play(make_policy("scripted", env), variation):
        pass
    return env


@pytest.mark.parametrize("actor", ["picker", "franka"])
@pytest.mark.parametrize("variation", [803, 811])
def test_a_towel_hangs_over_a_bar(page, actor, variation):
    env = played(page, actor, variation)
    assert env.info()["performance"] > 0.6
    assert max(env.task.actor.held) < 0
    bar = page["BAR"]
    points = env.task.towel.points()
    # It lies on the bar, and nothing is within it.
    distance = np.hypot(points[:, 0] - bar[0], points[:, 2] - bar[2])
    assert page["RADIUS"] < distance.min() < page["RADIUS"] + 0.02
    assert points[:, 2].max() < bar[2] + 0.03


def test_batches_play_it(page, register):
    """With the scores of single environments, whose functions the page writes for both."""
    register("hang_towel", page["HangTowel"])
    env = softgym_mj.load("hang_towel", split="all")
    envs = softgym_mj.make_vec("hang_towel", 2, device="host", split="all")
    env.reset(803)
    _, infos = envs.reset(options={"variation": [803, 811]})
    assert infos["performance"].tolist() == [0.0, 0.0]
    step, act = env.reset(803), make_policy("scripted", env)
    while not step.last():
        action = act(step)
        step = env.step(action)
        *_, infos = envs.step(np.stack([action, action]))
    assert env.info()["performance"] > 0.6
    np.testing.assert_allclose(infos["performance"][0], env.info()["performance"], atol=1e-9)
    envs.close()
