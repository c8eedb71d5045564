"""Reactive expert of DropFoldCloth: hand-computed actions, batches, whole episodes."""

import numpy as np
import pytest

from softgym_mj.policies.reactive import drop, drop_fold_cloth
from tests.policies.reactive_episodes import check_batches, entries, fast_or_all, play

WIDTH, DEPTH = 0.66, 0.5  # [m] The width is the middle of the band WIDE.
TOP, END = drop.WIDE.ends[0][0], max(drop.WIDE.ends[0][1], drop.LOWEST)


def seen(x, z, lag=0.0, held=(1, 1), width=WIDTH):
    """Returns "key_points" and "markov" of a straight cloth that hangs 5 cm below two pickers.

    Args:
        x, z: of the pickers [m].
        lag: distance along X by which the lower edge is ahead of them [m].
        held: grips.
        width: length of the cloth's rows [m].
    """
    share = np.linspace(0.0, 1.0, 8)
    y = np.linspace(DEPTH / 2, -DEPTH / 2, 8)
    points = np.zeros((8, 8, 3))
    points[..., 0], points[..., 1] = x + lag * share, y[:, None]
    points[..., 2] = z - 0.05 - np.sqrt(width**2 - lag**2) * share
    corners = points[[0, -1, 0, -1], [0, 0, -1, -1]]
    pickers = [[x, DEPTH / 2, z], [x, -DEPTH / 2, z]]
    grips = [[grip, 0.0, 0.0, -0.05 * (grip == 1)] for grip in held]
    parts = points, pickers, corners, pickers, grips
    return np.concatenate([np.ravel(part) for part in parts])


def test_pickers_rise_and_then_carry_the_cloth_over_the_beginning():
    begin = drop.WIDE.across[0][0]
    hover = TOP + drop.HOVER
    moves, grips = entries(drop_fold_cloth(seen(0.0, hover - 0.2)))
    np.testing.assert_allclose(moves, [[0.0, 0.0, drop.LIFTING]] * 2, atol=1e-9)
    assert grips.tolist() == [1.0, 1.0]
    # The lower edge trails by 2 cm.
    moves, _ = entries(drop_fold_cloth(seen(0.0, hover, lag=-0.02)))
    ahead = min(drop.APPROACH * begin / 0.08, drop.CARRYING) - drop.FOLLOW * 0.02 / 0.08
    np.testing.assert_allclose(moves, [[ahead, 0.0, 0.0]] * 2, atol=1e-9)


def test_pickers_wait_until_the_cloth_hangs_still():
    begin, hover = drop.WIDE.across[0][0], TOP + drop.HOVER
    moves, _ = entries(drop_fold_cloth(seen(begin, hover, lag=2 * drop.STILL)))
    follow = drop.FOLLOW * 2 * drop.STILL / 0.08
    np.testing.assert_allclose(moves, [[follow, 0.0, 0.0]] * 2, atol=1e-9)
    moves, grips = entries(drop_fold_cloth(seen(begin, hover)))
    np.testing.assert_allclose(moves[:, 2], -drop.WIDE.down[0][0], atol=1e-9)
    assert grips.tolist() == [1.0, 1.0]


def test_the_height_is_the_clock_of_the_swing():
    # Half of the way down is the fourth of seven X, and between the second and third speed.
    down = np.clip(np.mean(drop.WIDE.down[0][1:3]), drop.SLOWEST, 1.0)
    share = 0.5 + 0.08 * down / (TOP - END)
    x = np.interp(share, np.linspace(0.0, 1.0, 7), drop.WIDE.across[0])
    moves, grips = entries(drop_fold_cloth(seen(x - 0.04, (TOP + END) / 2, lag=-0.2)))
    np.testing.assert_allclose(moves, [[0.5, 0.0, -down]] * 2, atol=1e-9)
    assert grips.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("held", [(1, 1), (1, 0), (-1, 1), (0, 0)])
def test_pickers_release_the_cloth_at_the_end_and_leave(held):
    height = END - 1e-6 if held == (1, 1) else TOP
    moves, grips = entries(drop_fold_cloth(seen(0.4, height, lag=0.1, held=held)))
    up = np.clip((drop.RISEN - height) / 0.08, -drop.RISE, drop.RISE)
    np.testing.assert_allclose(moves, [[0.0, 0.0, up]] * 2, atol=1e-9)
    assert grips.tolist() == [-1.0, -1.0]


def test_the_width_chooses_the_curve():
    """The changes per half range of widths count at the ends of the bands."""
    for swing in (drop.NARROW, drop.WIDE):
        for share in (-0.9, 0.9):
            top = swing.ends[0][0] + share * swing.ends[1][0]
            begin = swing.across[0][0] + share * swing.across[1][0]
            width = swing.middle + share * drop.RANGE
            moves, _ = entries(drop_fold_cloth(seen(begin, top + drop.HOVER, width=width)))
            down = swing.down[0][0] + share * swing.down[1][0]
            speed = np.clip(down, drop.SLOWEST, 1.0)
            np.testing.assert_allclose(moves[:, 2], -speed, atol=1e-9)


@fast_or_all(range(700, 708), 4)
def test_it_folds_cloth_and_labels_batches_as_single_states(fidelity, variations):
    names = "key_points", "markov"
    _, scores, states = play("drop_fold_cloth", names, variations, fidelity=fidelity)
    assert np.mean(scores) > 0.75
    check_batches(drop_fold_cloth, states[::3], 1e-12)
