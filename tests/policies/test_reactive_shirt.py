"""Reactive expert of FoldShirt: hand-computed actions, symmetries, batches, whole episodes."""

import math

import numpy as np
import pytest

from softgym_mj.policies.reactive import arcs, fold_shirt, shirt
from tests.policies.reactive_episodes import check_batches, fast_or_all, play

CHEST, ARMHOLE, LENGTH, SLEEVE = 0.2, 0.16, 0.5, 0.15  # [m]
# Left half of a flat shirt in the order of key points: hem, cuff (inner, outer), armpit, shoulder.
LEFT = np.array(
    [
        [CHEST, -LENGTH],
        [CHEST + 0.1, -ARMHOLE - 0.05],
        [CHEST + SLEEVE, -0.04],
        [CHEST, -ARMHOLE],
        [CHEST, 0.0],
    ]
)
STRIDE = 0.08  # [m]
ABOVE = np.array([0.0, 0.0, 0.053])


def flat():
    """Returns the key points (11, 3) of a shirt at the origin, with its collar at the shoulders."""
    right = LEFT[::-1] * [-1.0, 1.0]
    return np.column_stack([np.concatenate([LEFT, [[0.0, 0.0]], right]), np.zeros(11)])


def folded_in():
    """Returns key points with both sleeves in."""
    keys = flat()
    for sign, ends in ((1.0, (1, 2)), (-1.0, (9, 8))):
        for end, radius in zip(ends, (0.1, SLEEVE), strict=True):
            keys[end, 0] = sign * (CHEST - radius)
    return keys


def seen(keys, pickers, held=(0, 0)):
    """Returns "markov" of pickers (2, 3), which hold what is 5.3 cm below them if `held` is 1."""
    grips = [[grip, *(-ABOVE if grip == 1 else np.zeros(3))] for grip in held]
    return np.concatenate([np.ravel(part) for part in (keys, pickers, grips)])


def moved(observation):
    """Returns displacements (2, 3) [m] and grips (2,)."""
    action = fold_shirt(observation).reshape(2, 4)
    return STRIDE * action[:, :3], action[:, 3].tolist()


def test_pickers_close_over_the_nearer_cuff():
    keys = flat()
    for ends in ([1, 2], [8, 9]):
        moves, grips = moved(seen(keys, keys[ends] + ABOVE))
        np.testing.assert_allclose(moves, 0.0, atol=1e-9)
        assert grips == [1.0, 1.0]
        moves, grips = moved(seen(keys, keys[ends] + ABOVE + [0.0, 0.0, 0.04]))
        np.testing.assert_allclose(moves, [[0.0, 0.0, -0.04]] * 2, atol=1e-9)
        assert grips == [1.0, 1.0]
        aside = math.copysign(0.036, keys[ends[0], 0])
        assert moved(seen(keys, keys[ends] + ABOVE + [aside, 0.0, 0.1]))[1] == [-1.0, -1.0]


@pytest.mark.parametrize("ends", [(1, 2), (9, 8)])
@pytest.mark.parametrize("angle", [0.4, 1.2])
def test_a_cuff_follows_half_circles_about_the_armhole(ends, angle):
    """Radii are the distances of the flat cuff's ends from the armhole, which come 20% closer."""
    keys, radii = flat(), np.array([0.1, SLEEVE])
    sign = math.copysign(1.0, keys[ends[0], 0])

    def places(angle, radii, along):
        share = (1.0 - math.cos(angle)) / 2
        across = CHEST + radii * math.cos(angle) + arcs.SHORT * share
        height = radii * math.sin(angle) + arcs.LAID * share
        return np.column_stack([sign * across, along, height])

    keys[list(ends)] = places(angle, radii, LEFT[1:3, 1])
    moves, grips = moved(seen(keys, keys[list(ends)] + ABOVE, (1, 1)))
    angle += 2 * arcs.PACE / radii.sum()
    after = places(angle, np.array([0.105, 0.145]), [-0.193, -0.057]) - keys[list(ends)]
    limit = shirt.SPEED * STRIDE
    after *= np.minimum(limit / np.abs(after).max(axis=1, keepdims=True), 1.0)
    np.testing.assert_allclose(moves, after, atol=4e-3)  # Circles end above their beginning.
    assert grips == [1.0, 1.0]


def test_a_cuff_is_released_at_its_reflection():
    keys = folded_in()
    keys[[8, 9], :] = flat()[[8, 9], :]
    keys[[1, 2], 2] = arcs.LAID
    moves, grips = moved(seen(keys, keys[[1, 2]] + ABOVE, (1, 1)))
    # Only towards each other by 20 % of their distances, and beyond the reflection.
    closer = [[arcs.SHORT - 0.005, 0.017, 0.0], [arcs.SHORT + 0.005, -0.017, 0.0]]
    np.testing.assert_allclose(moves, closer, atol=1e-6)
    assert grips == [-1.0, -1.0]
    keys[[1, 2], 2] += 0.02
    assert moved(seen(keys, keys[[1, 2]] + ABOVE, (1, 1)))[1] == [1.0, 1.0]


def test_a_cuff_beside_a_picker_at_the_lowest_height_is_released():
    keys = folded_in()
    keys[[1, 2], 2] = 0.04
    aside = np.array([0.0, -0.05, 0.01])
    observation = seen(keys, keys[[1, 2]] + aside, (1, 1))
    observation[[40, 41, 42, 44, 45, 46]] = [*-aside, *-aside]
    assert moved(observation)[1] == [-1.0, -1.0]


def test_a_sleeve_that_was_released_half_way_is_grasped_again():
    keys = folded_in()
    keys[[1, 2], 0] = CHEST
    over = keys[[1, 2]] + ABOVE + [0.0, 0.0, 0.03]
    moves, grips = moved(seen(keys, over))
    np.testing.assert_allclose(moves, [[0.0, 0.0, -0.03]] * 2, atol=1e-9)
    assert grips == [1.0, 1.0]


def test_a_picker_waits_for_the_other_one_and_opens_if_it_holds_something_else():
    keys = flat()
    pickers = keys[[1, 2]] + ABOVE
    pickers[1, 2] = 0.2
    moves, grips = moved(seen(keys, pickers, (1, 0)))
    np.testing.assert_allclose(moves[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(moves[1], [0.0, 0.0, -STRIDE], atol=1e-9)
    assert grips == [1.0, 1.0]
    # What it lifted by accident goes down again.
    lifted = keys + [0.0, 0.0, arcs.LAID + 0.01]
    moves, _ = moved(seen(lifted, pickers + [0.0, 0.0, arcs.LAID + 0.01], (1, 0)))
    np.testing.assert_allclose(moves[0], [0.0, 0.0, -0.01], atol=1e-9)
    pickers = np.array([keys[5], keys[2]]) + ABOVE  # The collar.
    assert moved(seen(keys, pickers, (1, 1)))[1] == [-1.0, 1.0]


def test_the_hem_follows_the_circle_that_ends_at_the_shoulders():
    keys, radius = folded_in(), LENGTH / 2
    keys[[0, 10], 0] *= shirt.TAUT
    keys[[0, 10], 1:] = -radius, radius + arcs.LAID
    moves, grips = moved(seen(keys, keys[[0, 10]] + ABOVE, (1, 1)))
    turn = arcs.PACE / radius
    np.testing.assert_allclose(moves[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(moves[:, 1], min(radius * math.sin(turn), 0.048), atol=3e-3)
    np.testing.assert_allclose(moves[:, 2], radius * (math.cos(turn) - 1.0), atol=0.012)
    assert grips == [1.0, 1.0]
    keys[[0, 10], 1:] = 0.0, arcs.LAID
    assert moved(seen(keys, keys[[0, 10]] + ABOVE, (1, 1)))[1] == [-1.0, -1.0]


def test_pickers_leave_a_folded_shirt():
    keys = folded_in()
    keys[[0, 10], 1] = -0.03
    moves, grips = moved(seen(keys, keys[[0, 10]] + ABOVE))
    np.testing.assert_allclose(moves, [[0.0, 0.0, STRIDE]] * 2, atol=1e-9)
    assert grips == [-1.0, -1.0]


def turned(states, matrix, reverse):
    """Returns states (n, 47) in a transformed world, with mirrored key points if `reverse`."""
    keys = states[:, :33].reshape(-1, 11, 3) @ matrix.T
    pickers = states[:, 33:39].reshape(-1, 2, 3) @ matrix.T
    grips = states[:, 39:].reshape(-1, 2, 4).copy()
    grips[..., 1:] = grips[..., 1:] @ matrix.T
    keys = keys[:, ::-1] if reverse else keys
    return np.concatenate([part.reshape(len(states), -1) for part in (keys, pickers, grips)], -1)


@fast_or_all((701, 702, 706, 709), 2)
def test_it_folds_shirts_and_is_symmetric(fidelity, variations):
    env, scores, states = play("fold_shirt", ["markov"], variations, fidelity=fidelity)
    assert np.mean(scores) > 0.88
    some = states[::7]
    single = check_batches(fold_shirt, some, 1e-9)
    # Speeds are limited along each axis, which rotations by right angles and reflections keep.
    for symmetry in env.task.symmetries:
        actions = fold_shirt(turned(some, symmetry.turn, symmetry.order == "reversed"))
        expected = single.reshape(-1, 2, 4).copy()
        expected[..., :3] = expected[..., :3] @ symmetry.turn.T
        np.testing.assert_allclose(actions.reshape(-1, 2, 4), expected, atol=1e-6)
