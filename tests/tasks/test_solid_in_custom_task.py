"""A solid in a task of one's own: the example of docs/custom_tasks.md, by pickers and by arms."""

import numpy as np
import pytest

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
