"""Reactive experts of pouring: hand-computed motions, batches, whole episodes."""

import math

import numpy as np
import pytest

from softgym_mj.policies import reactive
from softgym_mj.policies.reactive import pouring
from tests.policies.reactive_episodes import check_batches, fast_or_all, play

LENGTH, UP, RIM, TARGET = 0.2, 0.2, 0.25, 0.6  # [m] Cup's length and height, target's height and X.
ALONG = LENGTH / 2 + 0.045  # [m] Distance of the outer face from the middle.
OVER = TARGET - 0.1 + 0.02  # [m] X of the lip over the target, 0.02 m behind its inner face.


def lip_of(x, z, theta):
    """Returns the position (2,) [m] of the lip of a cup at a pose."""
    turned = ALONG * math.cos(theta) + UP * math.sin(theta)
    return np.array([x + turned, z - ALONG * math.sin(theta) + UP * math.cos(theta)])


def pose_of(lip, theta):
    """Returns the pose (3,) [m, m, rad] of a cup whose lip is at a position [m]."""
    return np.array([*(np.array(lip) - lip_of(0.0, 0.0, theta)), theta])


def seen(pose, surface, in_target=0.0, in_cup=1.0, share=None):
    """Returns "markov" of cups that are 0.2 m wide, the highest particle at `surface` [m]."""
    goal = [] if share is None else [0.1, share]
    sizes = [LENGTH, 0.2, UP, TARGET, RIM, 0.2, 0.2]
    return np.array([*pose, *sizes, surface, in_target, in_cup, *goal, *pose])


def moved(expert, state):
    """Returns the pose (3,) after an env step at 1 m/s and 1.5 rad/s, unless the cup is blocked."""
    return state[:3] + expert(state) * [0.08, 0.08, 0.12]


def test_a_cup_at_rest_starts_slowly_and_tilts_until_the_water_is_near_the_lip():
    state = seen((0.0, 0.0, 0.0), surface=0.1)
    pose = moved(reactive.pour_water, state)
    # The lip moves by 12 mm along both axes, and is 70 mm too high: more than 0.06 rad.
    np.testing.assert_allclose(lip_of(*pose), [ALONG + 0.012, UP + 0.012], atol=1e-12)
    assert pose[2] == pytest.approx(0.06)
    near = seen((0.0, 0.0, 0.0), surface=UP - 0.04)
    assert moved(reactive.pour_water, near)[2] == pytest.approx(1.5 * 0.01)
    full = seen((0.0, 0.0, 0.0), surface=UP - 0.02)
    assert moved(reactive.pour_water, full)[2] == 0.0


def test_the_lip_waits_beside_the_target_until_it_is_high_enough():
    theta = 1.0
    needed = RIM + 0.015 + 0.05 / math.tan(theta)
    beside = TARGET - 0.1 - 0.03 - 0.01
    low = pose_of((beside, needed - 0.04), theta)
    pose = moved(reactive.pour_water, seen(low, surface=needed - 0.1))
    assert lip_of(*pose)[0] == pytest.approx(beside)
    assert lip_of(*pose)[1] > needed - 0.04
    high = pose_of((beside, needed), theta)
    assert lip_of(*moved(reactive.pour_water, seen(high, surface=needed - 0.1)))[0] > beside


def over_target(theta, head, **water):
    """Returns the observation of a cup over the target, water `head` [m] above its edge."""
    lip = OVER, RIM + 0.015 + 0.05 / math.tan(theta)
    surface = lip[1] + 0.045 * math.sin(theta) + head
    return seen(pose_of(lip, theta), surface, **water)


def test_water_is_poured_at_a_constant_angular_velocity_until_the_cup_is_empty():
    pose = moved(reactive.pour_water, over_target(1.0, head=0.02, in_cup=0.9))
    assert pose[2] == pytest.approx(1.03)
    # The lip follows the height at which the cup's wall has clearance, and stays over the target.
    assert lip_of(*pose)[0] == pytest.approx(OVER)
    drained = over_target(math.radians(115.0), head=0.0, in_target=1.0, in_cup=0.0)
    assert moved(reactive.pour_water, drained)[2] == pytest.approx(math.radians(115.0))


def test_the_height_of_the_water_above_the_lip_depends_on_the_missing_share():
    # 0.17 - 0.02 are missing: a quarter of the flow, for which the water is 0.1 of the cup's height
    # above the edge. It is 30 mm above, so the cup turns back by 1.2 times the difference.
    state = over_target(1.0, head=0.03, in_target=0.2, in_cup=0.7, share=0.47)
    turned = moved(reactive.pour_water_amount, state)[2] - 1.0
    spare = -0.03 - 0.01 + 0.25 * 0.01
    assert turned == pytest.approx(1.2 * (spare / UP + 0.4 * 0.25))
    # Nothing is missing: it turns back until the water is 10 mm below the edge.
    enough = over_target(1.0, head=0.0, in_target=0.5, in_cup=0.5, share=0.5)
    assert moved(reactive.pour_water_amount, enough)[2] - 1.0 == pytest.approx(-1.2 * 0.01 / UP)
    below = over_target(1.0, head=-0.02, in_target=0.5, in_cup=0.5, share=0.5)
    assert moved(reactive.pour_water_amount, below)[2] == pytest.approx(1.0)


def test_the_cup_creeps_on_if_no_water_flows_although_some_is_missing():
    still = {"in_target": 0.4, "in_cup": 0.6, "share": 0.49}
    state = over_target(1.0, head=0.04, **still)
    assert moved(reactive.pour_water_amount, state)[2] - 1.0 == pytest.approx(0.005)
    flowing = over_target(1.0, head=0.04, **still | {"in_target": 0.3})
    assert moved(reactive.pour_water_amount, flowing)[2] < 1.0


def test_an_arm_moves_its_commanded_pose_as_if_the_cup_were_there():
    commanded = (0.1, 0.2, 0.1)
    # So far below the lip that the cup tilts as fast as it may in either pose.
    there = reactive.pour_water(seen(commanded, surface=0.1))
    behind = seen((0.05, 0.15, 0.0), surface=0.1)
    behind = np.concatenate([behind[:13], np.zeros(22), commanded])
    np.testing.assert_allclose(reactive.pour_water(behind), there, atol=1e-12)


@pytest.mark.parametrize(
    ("task", "size"),
    [("pour_water", 16), ("pour_water_amount", 18), ("pour_water", 38), ("pour_water_amount", 40)],
)
def test_batches_have_the_actions_of_single_observations(task, size):
    source = np.random.default_rng(0)
    states = source.uniform(0.05, 0.6, (60, size))
    states[:, 2] = source.uniform(0.0, 2.0, 60)
    check_batches(reactive.LABELS[task], states, 1e-12)


@fast_or_all(range(700, 710), 2)
def test_it_pours_all_of_the_water(fidelity, variations):
    _, scores, _ = play("pour_water", ["markov"], variations, fidelity=fidelity)
    assert np.min(scores) > 0.97


@fast_or_all(range(700, 710), 3)
def test_it_pours_a_share_of_the_water(fidelity, variations):
    env, scores, _ = play("pour_water_amount", ["markov"], variations, fidelity=fidelity)
    assert np.mean(scores) > 0.9
    assert env.info()["spilled"] < 0.02


@pytest.mark.long
@pytest.mark.parametrize("task", ["pour_water", "pour_water_amount"])
def test_arms_pour(task):
    _, scores, _ = play(task, ["markov"], range(700, 702), fidelity="fast", actor="franka")
    assert np.min(scores) > 0.9


def test_walls_are_those_of_all_variations():
    assert (pouring.WALL, pouring.TARGET_WALL) == (0.045, 0.03)
