"""The scripted experts solve single variations; the whole sweeps are in test_slow.py."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts import EXPERTS, make_policy


def play(task, variation, **kwargs):
    """Final info of an episode; whether the expert had finished by then is a key of its own."""
    env = softgym_mj.load(task, split="evaluate", **kwargs)
    act = make_policy(env)
    for _ in env.play(act, variation):
        pass
    return {**env.info(), "finished": act.finished}


def test_every_task_has_an_expert():
    assert set(EXPERTS) == set(softgym_mj.TASKS)


@pytest.mark.parametrize("actor", ["franka", pytest.param("sawyer", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "variation", [906, *(pytest.param(v, marks=pytest.mark.slow) for v in (927, 977))]
)
def test_arms_take_ends_of_a_rope_that_lie_close_together(actor, variation):
    # 1 to 3 cm apart, where two hands do not fit: done at once, it scores 0.3 at most.
    assert play("straighten_rope", variation, actor=actor)["success"]


@pytest.mark.parametrize(
    ("task", "variation", "actor"),
    [
        ("fold_cloth", 819, "franka"),  # A corner is out of reach.
        pytest.param("fold_cloth", 819, "sawyer", marks=pytest.mark.slow),
        pytest.param("drop_cloth", 801, "franka", marks=pytest.mark.slow),
        ("drop_cloth", 801, "sawyer"),  # Has to be swung out.
    ],
)
def test_arms_handle_cloth(task, variation, actor):
    info = play(task, variation, actor=actor, fidelity="fast")
    assert info["normalized_performance"] > 0.8


def test_straighten_rope_is_solved():
    assert play("straighten_rope", 801)["normalized_performance"] > 0.95


@pytest.mark.long
def test_spread_cloth_is_spread():
    info = play("spread_cloth", 810)
    assert info["normalized_performance"] > 0.95 and info["finished"]
    assert info["max_edge_strain"] < 0.15


@pytest.mark.long
def test_a_pile_is_folded():
    # Both ends of the middle column are hidden at first, so that it takes two rounds.
    info = play("fold_crumpled_cloth", 907)
    assert info["normalized_performance"] > 0.9 and info["finished"]


@pytest.mark.long
def test_a_rope_is_laid_in_the_shape_of_a_letter():
    info = play("rope_configuration", 816)
    assert info["normalized_performance"] > 0.9 and info["finished"]


@pytest.mark.parametrize(
    "variation",
    [
        pytest.param(953, marks=pytest.mark.long),
        *(pytest.param(v, marks=pytest.mark.slow) for v in (942, 989)),
    ],
)
def test_a_dropped_cloth_lies_folded(variation):
    # Let down in a pile on the right spot, it scores as much, but covers half of its place.
    info = play("drop_fold_cloth", variation)
    assert info["outline_iou"] >= 0.8
    assert info["mean_corner_distance"] <= 0.03


def test_water_is_carried_to_the_goal_without_a_drop():
    info = play("transport_water", 806, fidelity="fast")
    assert info["spilled"] == 0.0 and info["distance_to_target"] < 1e-3
    assert info["normalized_performance"] > 0.99 and info["success"]


def test_a_reckless_driver_spills():
    env = softgym_mj.load("transport_water", split="evaluate", fidelity="fast")
    timestep = env.reset(806)
    while not timestep.last():
        way = 1.2 - timestep.observation["reduced"][0]
        timestep = env.step(np.clip([way / 0.088], -1, 1))
    info = env.info()
    assert info["distance_to_target"] < 1e-9 and info["spilled"] > 0.01
    assert info["normalized_performance"] < 0.9


def test_water_is_poured():
    info = play("pour_water", 801, fidelity="fast")
    assert info["fraction_in_cup"] < 0.01 and info["normalized_performance"] > 0.85


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"num_pickers": 1}, "num_pickers=1"), ({"actor": "franka", "arms": 1}, "arms=1")],
)
def test_an_expert_needs_two_grippers(settings, words):
    with pytest.raises(InvalidArgumentError, match=f"^{words} is not valid: expected 2"):
        make_policy(softgym_mj.load("straighten_rope", **settings))
    with pytest.raises(InvalidArgumentError, match=f"^{words} is not valid: expected 2"):
        softgym_mj.load("drop_cloth", **settings)
