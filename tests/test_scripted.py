"""The scripted experts solve single variations; the whole sweeps are in test_slow.py."""

import pytest

import softgym_mj
from softgym_mj.baselines.scripted import EXPERTS, make_policy
from softgym_mj.exceptions import OutOfRangeError


def play(task, variation, **kwargs):
    """Final info of an episode."""
    env = softgym_mj.load(task, split="evaluate", **kwargs)
    act = make_policy(env)
    timestep = env.reset(variation)
    while not timestep.last():
        timestep = env.step(act(timestep))
    return env.info()


def test_every_task_has_an_expert():
    assert set(EXPERTS) == set(softgym_mj.TASKS)


def test_straighten_rope_is_solved_on_the_evaluation_variations():
    scores = [play("straighten_rope", v)["normalized_performance"] for v in range(800, 820)]
    assert sum(scores) / len(scores) >= 0.95


def test_spread_cloth_is_spread():
    info = play("spread_cloth", 803)
    assert info["normalized_performance"] > 0.8
    assert info["max_edge_strain"] < 0.15


def test_an_expert_needs_two_pickers():
    with pytest.raises(OutOfRangeError, match="num_grippers=1"):
        make_policy(softgym_mj.load("straighten_rope", num_pickers=1))
