"""Reactive expert of StraightenRope: hand-computed motions, batches, whole episodes."""

import numpy as np
import pytest

from softgym_mj.policies import reactive
from softgym_mj.policies.reactive.reach import BASE, OUTER
from softgym_mj.policies.reactive.straightening import (
    ACROSS,
    ARMS,
    ASIDE,
    CARRYING,
    PICKERS,
    PULLING,
    TRAVEL,
)
from tests.policies.reactive_episodes import check_batches, entries, fast_or_all, of_arms, play

STRIDE = 0.08  # [m] Displacement in an env step at full speed.
NONE = np.zeros((2, 3))  # Offsets of what hands hold in themselves.


def line(first, last):
    """Returns key points (10, 3) [m] on a line."""
    return np.linspace(first, last, 10)


def of_pickers(keys, centers, held=(0, 0), offsets=NONE):
    """Returns the observation "markov" (44,) of two pickers."""
    grips = np.column_stack([held, offsets])
    return np.concatenate([np.ravel(part) for part in (keys, centers, grips)])


def test_each_hand_goes_to_the_nearer_end_and_closes_just_beyond_it():
    keys = line([-0.15, 0.0, 0.006], [0.15, 0.0, 0.006])
    over = np.array([[0.15 + PICKERS.ahead, 0.0, 0.08], [-0.15 - PICKERS.ahead, 0.0, 0.08]])
    moves, grips = entries(reactive.straighten_rope(of_pickers(keys, over)))
    down = (0.006 + PICKERS.above - 0.08) / STRIDE
    np.testing.assert_allclose(moves, [[0.0, 0.0, down]] * 2, atol=1e-12)
    assert grips.tolist() == [-1.0, -1.0]
    low = over * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.006 + PICKERS.above]
    moves, grips = entries(reactive.straighten_rope(of_pickers(keys, low)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [1.0, 1.0]
    lost = reactive.straighten_rope(of_pickers(keys, low, (-1, 0)))
    assert entries(lost)[1].tolist() == [-1.0, 1.0]


def test_held_ends_move_apart_about_the_middle_until_they_are_half_a_meter_apart():
    ends = np.array([[-0.15, 0.0, PICKERS.carry - 0.03], [0.15, 0.0, PICKERS.carry - 0.03]])
    state = of_pickers(line(*ends), ends + [0.0, 0.0, 0.03], (1, 1), [[0.0, 0.0, -0.03]] * 2)
    moves, grips = entries(reactive.straighten_rope(state))
    pull = PULLING / STRIDE
    np.testing.assert_allclose(moves, [[-pull, 0.0, 0.0], [pull, 0.0, 0.0]], atol=1e-12)
    assert grips.tolist() == [1.0, 1.0]
    ends = np.array([[-0.25, 0.0, 0.01], [0.25, 0.0, 0.01]])
    state = of_pickers(line(*ends), ends + [0.0, 0.0, 0.03], (1, 1), [[0.0, 0.0, -0.03]] * 2)
    moves, grips = entries(reactive.straighten_rope(state))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [1.0, 1.0]


def test_arms_turn_the_rope_so_that_each_end_is_on_its_side():
    ends = np.array([[-0.1, 0.0, ARMS.carry], [0.1, 0.0, ARMS.carry]])
    moves, _ = entries(reactive.straighten_rope(of_arms(line(*ends), ends, ends, (1, 1))))
    way = np.array([0.0, 0.5]) - [0.2, 0.0]
    change = PULLING * way / np.linalg.norm(way)
    np.testing.assert_allclose(STRIDE * moves[:, :2], [-change, change], atol=1e-12)
    np.testing.assert_allclose(moves[:, 2], 0.0, atol=1e-12)


def test_one_arm_draws_its_end_aside_if_the_ends_are_close_together():
    keys = line([0.0, 0.05, 0.006], [0.0, 0.0, 0.006])
    idle = np.array([[0.0, -ASIDE, TRAVEL], [0.0, 0.05 + ARMS.ahead, 0.006 + ARMS.above]])
    moves, grips = entries(reactive.straighten_rope(of_arms(keys, idle, idle)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [-1.0, 1.0]
    keys[0, 2] = ARMS.carry
    holding = np.array([idle[0], keys[0]])
    moves, grips = entries(reactive.straighten_rope(of_arms(keys, holding, holding, (0, 1))))
    np.testing.assert_allclose(moves, [[0.0, 0.0, 0.0], [0.0, CARRYING, 0.0]], atol=1e-12)
    assert grips.tolist() == [-1.0, 1.0]


def test_an_arm_lays_an_end_beyond_the_middle_if_the_other_arm_does_not_reach_its_own():
    far = OUTER - BASE + 0.05
    keys = line([0.0, far, 0.006], [0.0, far + 0.2, 0.006])
    centers = np.array([[0.0, -ASIDE, TRAVEL], [0.0, far - ARMS.ahead, 0.006 + ARMS.above]])
    _, grips = entries(reactive.straighten_rope(of_arms(keys, centers, centers)))
    assert grips.tolist() == [-1.0, 1.0]  # The arm at +Y takes the end for the other one.
    keys[0] = centers[1]
    moves, grips = entries(reactive.straighten_rope(of_arms(keys, centers, centers, (0, 1))))
    assert moves[1, 1] == pytest.approx(-CARRYING) and grips.tolist() == [-1.0, 1.0]
    keys[0] = centers[1] = [0.0, -ACROSS, ARMS.laid]
    _, grips = entries(reactive.straighten_rope(of_arms(keys, centers, centers, (0, 1))))
    assert grips.tolist() == [-1.0, -1.0]


def test_a_hand_lays_another_part_of_the_rope_aside():
    keys = line([-0.15, 0.0, 0.006], [0.15, 0.0, 0.006])
    keys[4] = [-0.1, 0.0, PICKERS.carry]
    centers = np.array([[-0.1, 0.0, PICKERS.carry], [0.3, 0.3, TRAVEL]])
    moves, grips = entries(reactive.straighten_rope(of_pickers(keys, centers, (1, 0))))
    np.testing.assert_allclose(moves[0], [-CARRYING, 0.0, 0.0], atol=1e-12)
    assert grips[0] == 1.0
    centers[0, 0] = -0.26
    keys[4] = centers[0]
    assert entries(reactive.straighten_rope(of_pickers(keys, centers, (1, 0))))[1][0] == -1.0


def test_batches_have_the_actions_of_single_observations():
    source = np.random.default_rng(0)
    for size, grips in ((44, slice(36, None, 4)), (88, slice(74, 82, 4))):
        states = 0.1 * source.standard_normal((60, size))
        states[:, grips] = source.integers(-1, 2, (60, 2))
        check_batches(reactive.straighten_rope, states, 1e-12)


@pytest.mark.parametrize("actor", ["picker", "franka"])
@fast_or_all(range(700, 710), 3)
def test_it_straightens_ropes(fidelity, variations, actor):
    _, scores, _ = play("straighten_rope", ["markov"], variations, fidelity=fidelity, actor=actor)
    assert np.min(scores) > 0.98
