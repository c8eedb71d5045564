"""Reactive expert of FoldCrumpledCloth: hand-computed actions, batches, whole episodes."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.cloth import Cloth
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.reactive import cloth, fold_crumpled_cloth, grasps, laying
from tests.policies.reactive_cloths import BELOW, DIMS, flat, seen
from tests.policies.reactive_episodes import check_batches, entries, fast_or_all, play


def hanging(points):
    """Returns vertices of a cloth that hangs by its middle column over the edges' place."""
    half = np.ptp(points[:, 0]) / 2
    height = half - np.abs(points[:, 0])
    return np.column_stack([half + 1e-6 * np.sign(points[:, 0]), points[:, 1], height])


def ends(points):
    """Returns both ends (2, 3) [m] of the middle column."""
    rows, columns = Cloth(dims=DIMS, fidelity="fast").shape
    return points.reshape(rows, columns, 3)[[0, -1], columns // 2]


def test_an_observation_shows_sizes_and_what_is_held():
    points = flat()
    for number in (143, 300):
        sheet, hands = grasps.parsed(seen(points, ends(points) - BELOW, (1, -1), number=number))
        assert (sheet.rows, sheet.columns, sheet.present.sum()) == (13, 11, 143)
        np.testing.assert_allclose(sheet.size, [0.4, 0.5], atol=1e-12)
        np.testing.assert_allclose(sheet.flat[:143], points[:, :2], atol=1e-12)
        assert hands.held[0] == 5 and hands.holds.tolist() == [True, False]
        assert hands.lost.tolist() == [False, True]


def test_free_pickers_grasp_the_ends_of_the_middle_column_from_outside():
    points = flat()
    # Of the directions that the floor allows, 55 degrees outwards is the best.
    outside = np.array([0.0, np.cos(np.radians(55.0)), np.sin(np.radians(55.0))])
    grasp = ends(points) + grasps.REACH * np.array([outside, outside * [1.0, -1.0, 1.0]])
    moves, grips = entries(fold_crumpled_cloth(seen(points, grasp)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-9)
    assert grips.tolist() == [1.0, 1.0]
    # A picker that lost its hold opens first; one above its grasp descends along the direction.
    pickers = [grasp[0] + 0.05 * outside, grasp[1]]
    moves, grips = entries(fold_crumpled_cloth(seen(points, pickers, (0, -1))))
    np.testing.assert_allclose(moves[0], -0.05 / 0.08 * outside, atol=1e-9)
    assert grips.tolist() == [1.0, -1.0]
    # It closes on the way, within 10 cm along the direction and 4 cm beside it.
    near = (0.099, 0.0, 1.0), (0.101, 0.0, -1.0), (0.0, 0.039, 1.0), (0.0, 0.041, -1.0)
    for along, beside, grip in near:
        pickers = [grasp[0] + along * outside + [beside, 0.0, 0.0], grasp[1]]
        assert entries(fold_crumpled_cloth(seen(points, pickers)))[1].tolist() == [grip, 1.0]


def test_a_picker_with_an_end_lifts_it_and_the_other_one_fetches_the_opposite_end():
    points = flat()
    pickers = [ends(points)[0] - BELOW, [0.0, -0.6, 0.3]]
    moves, grips = entries(fold_crumpled_cloth(seen(points, pickers, (1, 0))))
    # The end has its place at Y = 0.25 m already: it is lifted.
    way = cloth.DRAGGED - pickers[0][2]
    assert way > 0.1
    np.testing.assert_allclose(moves[0], [0.0, 0.0, cloth.LIFTING], atol=1e-9)
    assert grips.tolist() == [1.0, -1.0]
    assert moves[1, 1] > 0.0 > moves[1, 2]
    # A corner is no end: the other picker fetches an end while it is lifted.
    corner = [points[0] - BELOW, [0.0, -0.6, 0.3]]
    moves, grips = entries(fold_crumpled_cloth(seen(points, corner, (1, 0))))
    assert moves[0, 2] == cloth.LIFTING and grips.tolist() == [1.0, -1.0]


def test_pickers_lay_a_hanging_cloth_down_an_arc():
    points = hanging(flat())
    # An arc of half of the cloth's 0.4 m, longer and lower by 0.27 m / 0.2 m and 0.9; its next
    # point is 0.06 m from the top.
    longer = 1.0 + laying.BEYOND / 0.2
    pickers = ends(points) - BELOW
    pickers[:, 0] += laying.BEYOND
    moved = points + [laying.BEYOND, 0.0, 0.0]
    moves, grips = entries(fold_crumpled_cloth(seen(moved, pickers, (1, 1))))
    way = np.array([-0.06 * longer, 0.0, laying.LOWER * np.sqrt(0.2**2 - 0.06**2) - 0.2])
    np.testing.assert_allclose(moves, [cloth.LAYING * way / way[0] * -1.0] * 2, atol=1e-4)
    assert grips.tolist() == [1.0, 1.0]
    # Elsewhere it is carried to the top first.
    points = points + [-0.4, 0.0, 0.15]
    moves, grips = entries(fold_crumpled_cloth(seen(points, ends(points) - BELOW, (1, 1))))
    assert (moves[:, 0] == cloth.LAYING).all() and grips.tolist() == [1.0, 1.0]


def folded():
    """Returns vertices of a folded cloth on the floor."""
    points = flat()
    points[:, 2] += 0.01 * (points[:, 0] < 0.0)
    points[:, 0] = np.abs(points[:, 0])
    return points


def test_pickers_release_a_fold_together_and_leave_it():
    points = folded()
    low = ends(points) - BELOW
    assert entries(fold_crumpled_cloth(seen(points, low, (1, 1))))[1].tolist() == [-1.0, -1.0]
    high = points.copy()
    high[5, 2] += 0.05
    above = ends(high) - BELOW
    assert entries(fold_crumpled_cloth(seen(high, above, (1, 1))))[1].tolist() == [1.0, 1.0]
    moves, grips = entries(fold_crumpled_cloth(seen(points, low)))
    np.testing.assert_allclose(moves, [[0.0, 0.0, 1.0]] * 2, atol=1e-9)
    assert grips.tolist() == [-1.0, -1.0]


def test_the_error_of_a_fold_is_that_of_the_task():
    env = softgym_mj.load(
        "fold_crumpled_cloth", split=[700], observation=["full", "markov"], fidelity="fast"
    )
    assert isinstance(env, Environment)
    step = env.reset(700)
    state = np.concatenate([step.observation["full"], step.observation["markov"]])
    sheet, _ = grasps.parsed(state)
    # The task measures at SoftGym's particles instead of vertices.
    error = cloth._error(sheet) * np.mean(sheet.size)
    assert error == pytest.approx(-env.info()["performance"], rel=0.1)


@fast_or_all(range(700, 704), 2)
def test_it_folds_cloth_and_labels_batches_as_single_states(fidelity, variations):
    names = "full", "markov"
    _, scores, states = play("fold_crumpled_cloth", names, variations, fidelity=fidelity)
    assert np.mean(scores) > 0.5
    check_batches(fold_crumpled_cloth, states[::7], 1e-9)
