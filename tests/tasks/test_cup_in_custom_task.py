"""A cup as the tool of a custom task: the example of docs/custom_tasks.md, by cup and by arm."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from tests.custom_tasks import defined_with

TIPPED = 2.0  # [rad]


@pytest.fixture(scope="module")
def task():
    """The class that the page defines."""
    return defined_with("WaterTheRope")["WaterTheRope"]


@pytest.mark.parametrize("actor", ["cup", pytest.param("ur5e", marks=pytest.mark.slow)])
def test_a_cup_waters_a_rope(task, actor):
    env = Environment(task(actor=actor), name="water_the_rope", horizon=60, split="evaluate")
    env.reset(800)
    actor, cup, water = env.task.actor, env.task.cup, env.task.water
    assert env.action_spec().shape == (3,)
    assert cup.inside(water.points()).all() and env.info()["performance"] == 0.0
    start = np.array(cup.pose)
    for _ in range(3):  # Up by 3 * 8 sim steps of 1 cm, at full speed.
        env.step(np.array([0.0, 1.0, 0.0]))
    for _ in range(10):
        env.step(np.zeros(3))
    np.testing.assert_allclose(cup.pose - start, [0.0, 0.24, 0.0], atol=0.02)
    assert cup.inside(water.points()).mean() > 0.98
    turns, wet = round(2 * TIPPED / (8 * actor.max_step[2])), []
    for _ in range(turns):  # At half of its speed.
        env.step(np.array([0.0, 0.0, 0.5]))
        wet.append(env.info()["performance"])
    for _ in range(5):
        env.step(np.zeros(3))
    assert cup.pose[2] == pytest.approx(turns * 4 * actor.max_step[2], abs=0.03)
    assert cup.inside(water.points()).mean() < 0.05
    # It lands on the rope, and spreads over the floor.
    assert max(wet) > 0.3 and max(wet[: turns // 2]) < 0.05


def test_grippers_cannot_act_there(task):
    with pytest.raises(InvalidArgumentError, match="actor='picker'"):
        task(actor="picker")


def test_batches_refuse_its_two_objects(task, register):
    register("water_the_rope", task)
    with pytest.raises(InvalidArgumentError, match=r"several objects \['water', 'rope'\].*'cpu'"):
        softgym_mj.make_vec("water_the_rope", 1, device="host")
