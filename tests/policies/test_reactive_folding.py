"""Reactive expert of FoldCloth: hand-computed motions, batches, whole episodes."""

import math

import numpy as np
import pytest

from softgym_mj.policies import reactive
from softgym_mj.policies.reactive.folding import ARMS, PICKERS, REST, SHORT
from softgym_mj.policies.reactive.reach import BASE, OUTER
from tests.policies.reactive_episodes import check_batches, entries, fast_or_all, of_arms, play

# [m] Corners of a cloth of 0.4 m: both ends of column 0, then of the last one.
FLAT = np.array([[-0.2, y, 0.005] for y in (0.2, -0.2)] + [[0.2, y, 0.005] for y in (0.2, -0.2)])
CENTER = 0.045  # [m] Height of pickers above the corners that they hold.
LOW, LOWER, PACE, LANDING = PICKERS.low, PICKERS.lower, PICKERS.pace, PICKERS.landing


def seen(corners, centers, grips=(0, 0)):
    """Returns the observation "markov" (26,); pickers hold what is `CENTER` below them."""
    held = np.column_stack([grips, np.tile([0.0, 0.0, -CENTER], (2, 1))])
    return np.concatenate([np.ravel(part) for part in (corners, centers, held)])


def carried(way, height):
    """Returns the observation of both corners held at a distance from the end, and a height [m]."""
    corners = FLAT.copy()
    corners[:2, 0], corners[:2, 2] = 0.2 - SHORT - way, height
    return seen(corners, corners[:2] + [0.0, 0.0, CENTER], (1, 1))


def test_each_picker_goes_to_the_nearer_corner_and_closes_there():
    over = FLAT[:2] + [0.0, 0.0, 0.1]
    for order in ([0, 1], [1, 0]):
        moves, grips = entries(reactive.fold_cloth(seen(FLAT, over[order])))
        np.testing.assert_allclose(moves, [[0.0, 0.0, (LOW - 0.105) / 0.08]] * 2, atol=1e-12)
        assert grips.tolist() == [-1.0, -1.0]
        low = FLAT[:2] * [1.0, 1.0, 0.0] + [0.0, 0.0, LOW]
        moves, grips = entries(reactive.fold_cloth(seen(FLAT, low[order])))
        np.testing.assert_allclose(moves, 0.0, atol=1e-12)
        assert grips.tolist() == [1.0, 1.0]


def test_a_picker_that_holds_its_corner_waits_for_the_other_one():
    centers = FLAT[:2] + [[0.0, 0.0, CENTER], [0.0, 0.0, 0.1]]
    moves, grips = entries(reactive.fold_cloth(seen(FLAT, centers, (1, 0))))
    np.testing.assert_allclose(moves[0], 0.0, atol=1e-12)
    assert grips.tolist() == [1.0, -1.0] and moves[1, 2] < 0.0


def test_a_picker_opens_first_after_a_release_under_load():
    low = FLAT[:2] * [1.0, 1.0, 0.0] + [0.0, 0.0, LOW]
    assert entries(reactive.fold_cloth(seen(FLAT, low, (-1, 0))))[1].tolist() == [-1.0, 1.0]


def test_held_corners_move_on_a_flat_half_circle_that_ends_at_their_mirror_images():
    radius, step = 0.15, PACE / 0.15
    for angle in (1.0, math.pi / 2, 2.5):
        way, height = radius * (1 - math.cos(angle)), LANDING + LOWER * radius * math.sin(angle)
        moves, grips = entries(reactive.fold_cloth(carried(way, height)))
        following = radius * (1 - math.cos(angle - step))
        rise = LANDING + LOWER * radius * math.sin(angle - step) - height
        np.testing.assert_allclose(0.08 * moves, [[way - following, 0.0, rise]] * 2, atol=1e-12)
        assert grips.tolist() == [1.0, 1.0]


def test_pickers_release_corners_at_their_mirror_images_and_rest():
    assert entries(reactive.fold_cloth(carried(0.0, LANDING + 0.005)))[1].tolist() == [-1.0, -1.0]
    folded = FLAT.copy()
    folded[:2, 0] = 0.19
    centers = folded[:2] * [1.0, 1.0, 0.0] + [0.0, 0.0, REST]
    moves, grips = entries(reactive.fold_cloth(seen(folded, centers)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [-1.0, -1.0]


def test_cloth_may_lie_at_any_angle():
    turn = np.array([[math.cos(0.7), -math.sin(0.7)], [math.sin(0.7), math.cos(0.7)]])

    def turned(points):
        return np.concatenate([points[:, :2] @ turn.T, points[:, 2:]], axis=1)

    state = carried(0.2, 0.15)
    corners, centers = state[:12].reshape(4, 3), state[12:18].reshape(2, 3)
    moves, _ = entries(reactive.fold_cloth(state))
    again, _ = entries(reactive.fold_cloth(seen(turned(corners), turned(centers), (1, 1))))
    np.testing.assert_allclose(again, turned(moves), atol=1e-12)


def test_arms_brake_on_the_way_to_the_corners_on_their_sides():
    commanded = np.array([[-0.2, y, ARMS.low + 0.05] for y in (-0.2, 0.2)])
    lagging = commanded + [0.0, 0.0, 0.03]
    moves, grips = entries(reactive.fold_cloth(of_arms(FLAT, lagging, commanded)))
    np.testing.assert_allclose(0.08 * moves, [[0.0, 0.0, -0.6 * 0.05]] * 2, atol=1e-12)
    assert grips.tolist() == [-1.0, -1.0]
    there = np.array([[-0.2, y, ARMS.low] for y in (-0.2, 0.2)])
    moves, grips = entries(reactive.fold_cloth(of_arms(FLAT, there, there)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [1.0, 1.0]


def test_commanded_corners_move_on_a_half_circle_and_arms_release_when_they_have_arrived():
    radius, angle, step = 0.15, 1.0, ARMS.pace / 0.15
    corners = FLAT.copy()
    corners[:2, 0] = 0.2 - SHORT - radius * (1 - math.cos(angle))
    corners[:2, 2] = ARMS.landing + ARMS.lower * radius * math.sin(angle)
    commanded = corners[[1, 0]]
    for lag in (0.0, 0.02):
        lagging = corners.copy()
        lagging[:2, 0] -= lag
        state = of_arms(lagging, lagging[[1, 0]], commanded, (1, 1))
        moves, grips = entries(reactive.fold_cloth(state))
        following = radius * (math.cos(angle) - math.cos(angle - step))
        rise = ARMS.lower * radius * (math.sin(angle - step) - math.sin(angle))
        np.testing.assert_allclose(0.08 * moves, [[-following, 0.0, rise]] * 2, atol=1e-12)
        assert grips.tolist() == [1.0, 1.0]
    corners[:2] = FLAT[2:] * [1.0, 1.0, 0.0] + [-SHORT, 0.0, ARMS.landing]
    state = of_arms(corners, corners[[1, 0]], corners[[1, 0]], (1, 1))
    assert entries(reactive.fold_cloth(state))[1].tolist() == [-1.0, -1.0]


def test_arms_grasp_the_side_of_the_cloth_where_they_reach_it_and_its_mirror_image():
    corners = np.array([[x, y, 0.005] for x in (-0.3, 0.3) for y in (0.45, 0.05)])
    x = math.sqrt(OUTER**2 - (BASE + 0.05) ** 2)  # The corner is sqrt(0.3^2 + 0.75^2) m away.
    grasps = np.array([[-x, 0.05, ARMS.low], [-0.3, 0.45, ARMS.low]])
    moves, grips = entries(reactive.fold_cloth(of_arms(corners, grasps, grasps)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [1.0, 1.0]
    laid = [[x + SHORT, 0.05, ARMS.landing], [0.3 + SHORT, 0.45, ARMS.landing]]
    # The corner hangs back from what the arm holds.
    corners[0], corners[1] = laid[1], np.array(laid[0]) - [0.3 - x, 0.0, 0.0]
    state = of_arms(corners, laid, laid, (1, 1))
    assert entries(reactive.fold_cloth(state))[1].tolist() == [-1.0, -1.0]


def test_batches_have_the_actions_of_single_observations():
    source = np.random.default_rng(0)
    for size, grips in ((26, slice(18, None, 4)), (70, slice(56, 64, 4))):
        states = 0.2 * source.standard_normal((60, size))
        states[:, grips] = source.integers(-1, 2, (60, 2))
        check_batches(reactive.fold_cloth, states, 1e-12)


@fast_or_all(range(700, 710), 3)
def test_it_folds_cloths(fidelity, variations):
    _, scores, _ = play("fold_cloth", ["markov"], variations, fidelity=fidelity)
    assert np.mean(scores) > 0.93 and np.min(scores) > 0.85


@fast_or_all(range(700, 710), 2)
def test_arms_fold_cloths(fidelity, variations):
    _, scores, _ = play("fold_cloth", ["markov"], variations, fidelity=fidelity, actor="franka")
    assert np.mean(scores) > 0.93 and np.min(scores) > 0.85


@pytest.mark.parametrize("end", [0.0, 1e-9])
def test_actions_are_finite_at_the_end_of_the_half_circle(end):
    assert np.isfinite(reactive.fold_cloth(carried(end, LANDING))).all()
