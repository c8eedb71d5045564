"""Reactive expert of SpreadCloth: hand-computed actions, fits, batches, whole episodes."""

import numpy as np
import pytest

from softgym_mj.entities.cloth import Cloth
from softgym_mj.policies.reactive import grasps, lifting, mending, spread_cloth, unrolling
from softgym_mj.policies.reactive.flat_fit import flat_fit
from tests.policies.reactive_cloths import BELOW, DIMS, flat, seen
from tests.policies.reactive_episodes import check_batches, entries, fast_or_all, play

AWAY = [[0.2, 0.3, 0.3], [-0.2, -0.3, 0.3]]


def moved(points, angle, way):
    """Returns points (n, 3) [m], rotated about Z by an angle [rad] and translated by a way [m]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) + way


def hanging(points, x, height):
    """Returns vertices of a cloth that hangs by its last column along Y and trails towards -X."""
    behind = points[:, 0].max() - points[:, 0]
    down = np.minimum(behind, height)
    return np.column_stack([x - (behind - down), points[:, 1], height - down])


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_the_fit_finds_a_flat_cloth_with_a_fold_and_either_side_up(mirror):
    points = moved(flat() * [1.0, mirror, 1.0], 0.7, [0.1, -0.2, 0.0])
    sheet, _ = grasps.parsed(seen(points, AWAY))
    fit = flat_fit(sheet)
    np.testing.assert_allclose(fit.places[:143], points[:, :2], atol=1e-9)
    np.testing.assert_allclose(fit.errors[:143], points[:, 2], atol=1e-9)
    # Folded corners hardly count: their edges lengthen the cloth by a few percent.
    folded = points.copy()
    folded[[0, 1, 11]] = points[[24, 23, 34]] + [0.0, 0.0, 0.01]
    sheet, _ = grasps.parsed(seen(folded, AWAY))
    np.testing.assert_allclose(flat_fit(sheet).places[:143], points[:, :2], atol=0.015)


def test_pickers_leave_a_flat_cloth():
    moves, grips = entries(spread_cloth(seen(flat(), [[0.2, 0.3, 0.1], [-0.2, -0.3, 0.1]])))
    np.testing.assert_allclose(moves, [[0.0, 0.0, 1.0]] * 2, atol=1e-9)
    assert grips.tolist() == [-1.0, -1.0]


def test_a_picker_drags_a_corner_to_its_place_and_releases_it_there():
    points = flat()
    place = points[0].copy()
    points[0] += [0.16, 0.0, 0.02]
    # Towards the place, at 0.15 m at most: half of the distance is less.
    moves, grips = entries(spread_cloth(seen(points, [points[0] - BELOW, AWAY[1]], (1, 0))))
    height = mending.STEEP * 0.16
    way = np.array([place[0] - points[0, 0], 0.0, height - 0.02 - place[2]])
    np.testing.assert_allclose(moves[0], mending.DRAGGING * way / 0.16, atol=0.05)
    assert grips.tolist() == [1.0, -1.0]
    points[0] = place + [0.02, 0.0, 0.0]
    assert entries(spread_cloth(seen(points, [points[0] - BELOW, AWAY[1]], (1, 0))))[1][0] == -1.0


def test_a_picker_with_a_corner_lifts_crumpled_cloth_and_the_other_one_fetches_the_next():
    # Cloth hangs in a line from a corner; what reaches the floor lies beside it.
    points = flat()
    behind = np.linalg.norm(points - points[10], axis=1)
    corner = np.array([0.1, 0.2, 0.3])
    points = corner - np.column_stack(
        [np.clip(behind - 0.3, 0.0, None), 0.0 * behind, np.clip(behind, 0.0, 0.3)]
    )
    moves, grips = entries(spread_cloth(seen(points, [corner - BELOW, AWAY[1]], (1, 0))))
    way = np.array([-corner[0], -0.5 * corner[1], grasps.TOP - corner[2] - 0.05])
    np.testing.assert_allclose(moves[0], lifting.LIFTING * way / np.abs(way).max(), atol=1e-9)
    assert grips.tolist() == [1.0, -1.0]
    assert moves[1, 2] < 0.0  # It descends.
    points[0] = [0.3, -0.2, 0.006]  # Exposed, beside all others.
    moves, grips = entries(spread_cloth(seen(points, [corner - BELOW, AWAY[1]], (1, 0))))
    np.testing.assert_allclose(moves[0], lifting.SLOWLY * way / np.abs(way).max(), atol=1e-9)
    assert grips.tolist() == [1.0, -1.0]
    assert moves[1, 0] == 1.0  # At full speed.


def ball(held, height):
    """Returns vertices of a cloth in a ball that hides its corners, but for a held one above it."""
    rows, columns = Cloth(dims=DIMS, fidelity="fast").shape
    row, column = np.divmod(np.arange(rows * columns), columns)
    inside = np.minimum(row, rows - 1 - row) + np.minimum(column, columns - 1 - column) <= 4
    source = np.random.default_rng(0).standard_normal((rows * columns, 3))
    points = source / np.linalg.norm(source, axis=1)[:, None]
    points = np.where(inside[:, None], 0.01, 0.05) * points + [0.0, 0.0, 0.06]
    points[held] = [0.0, 0.0, height]
    return points


def test_a_picker_drops_cloth_whose_corners_are_hidden_when_it_is_up():
    for height, grip in (0.3, 1.0), (0.4, -1.0):
        points = ball(71, height)
        moves, grips = entries(spread_cloth(seen(points, [points[71] - BELOW, AWAY[1]], (1, 0))))
        assert grips.tolist() == [grip, -1.0] and moves[0, 2] >= 0.0


def test_without_an_exposed_corner_one_picker_takes_the_highest_vertex():
    points = ball(71, 0.15)
    pickers = [points[71] + [0.0, 0.0, grasps.REACH], [0.0, -0.3, 0.3]]
    moves, grips = entries(spread_cloth(seen(points, pickers)))
    np.testing.assert_allclose(moves, [[0.0] * 3, [0.0, -0.05 / 0.08, 0.0]], atol=1e-9)
    assert grips.tolist() == [1.0, -1.0]


def test_pickers_lay_a_cloth_down_an_arc_from_its_free_edge():
    points = hanging(flat(), 0.0, 0.28)  # The first column trails 0.12 m behind the last one.
    last = points.reshape(13, 11, 3)[[0, -1], -1]
    moves, grips = entries(spread_cloth(seen(points, last - BELOW, (1, 1))))
    radius, ahead = unrolling.SHORTER * 0.4, 0.12 + unrolling.PACE
    height = unrolling.LOWER * np.sqrt(radius**2 - ahead**2)
    way = np.array([unrolling.PACE, 0.0, height - 0.28])
    expected = way / max(0.08, np.abs(way).max() / unrolling.LAYING)
    np.testing.assert_allclose(moves, [expected] * 2, atol=1e-9)
    assert grips.tolist() == [1.0, 1.0]
    # Where it lies, they release it.
    spread = flat()
    last = spread.reshape(13, 11, 3)[[0, -1], -1]
    assert entries(spread_cloth(seen(spread, last - BELOW, (1, 1))))[1].tolist() == [-1.0, -1.0]


def exchanged(states):
    """Returns states ("full", "markov") (n, k) with exchanged pickers."""
    full, markov = np.split(states, [states.shape[1] - 26], axis=1)
    centers, grips = markov[:, 12:18].reshape(-1, 2, 3), markov[:, 18:].reshape(-1, 2, 4)
    other = [each[:, ::-1].reshape(len(states), -1) for each in (centers, grips)]
    return np.concatenate([full[:, :-6], other[0], markov[:, :12], *other], axis=1)


def reflected(states):
    """Returns states ("full", "markov") (n, k) at the plane Y = 0."""
    points, grips = np.split(states, [states.shape[1] - 8], axis=1)
    points = points.reshape(len(states), -1, 3) * [1.0, -1.0, 1.0]
    grips = grips.reshape(-1, 2, 4) * [1.0, 1.0, -1.0, 1.0]
    return np.concatenate([each.reshape(len(states), -1) for each in (points, grips)], axis=1)


@fast_or_all(range(700, 708), 2)
def test_it_spreads_cloth_and_labels_batches_as_single_states(fidelity, variations):
    names = "full", "markov"
    _, scores, states = play("spread_cloth", names, variations, fidelity=fidelity)
    assert np.mean(scores) > 0.75
    check_batches(spread_cloth, states[::7], 1e-9)
    # Students may learn from exchanged pickers and reflected states.
    labels = spread_cloth(states).reshape(-1, 2, 4)
    np.testing.assert_array_equal(spread_cloth(exchanged(states)), labels[:, ::-1].reshape(-1, 8))
    labels = (labels * [1.0, -1.0, 1.0, 1.0]).reshape(-1, 8)
    same = np.abs(spread_cloth(reflected(states)) - labels).max(axis=-1) < 1e-6
    assert same.mean() > 0.99  # Equal values of two grasps are decided by their order.
