"""Distances between clouds against brute force and against numbers worked out by hand."""

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import metrics

NEAR = 1e-9  # [m]


def brute(points, cloud, order):
    """Distance of each point from the nearest of a cloud, by all pairs."""
    apart = points[:, None] - cloud[None]
    return np.linalg.norm(apart, ord=order, axis=2).min(axis=1)


def clouds():
    rng = np.random.default_rng(0)
    ties = np.array([[x, y, 0.0] for x in range(4) for y in range(4)]) * 0.1
    middles = ties[:9] + [0.05, 0.05, 0.0]  # As far from four points each.
    return {
        "random": (rng.normal(size=(57, 3)), rng.normal(size=(211, 3))),
        "one point": (rng.normal(size=(1, 3)), rng.normal(size=(30, 3))),
        "one real point": (rng.normal(size=(30, 3)), rng.normal(size=(1, 3))),
        "ties": (ties, middles),
        "the same": (ties, np.concatenate([ties, ties])),
        "far away": (rng.normal(size=(20, 3)) + 100.0, rng.normal(size=(20, 3))),
    }


@pytest.mark.parametrize("name", clouds())
def test_distances_are_those_of_all_pairs(name):
    sim, real = clouds()[name]
    rag = metrics.rag_distances(sim, real)
    assert rag.chamfer == pytest.approx(np.mean(brute(sim, real, 1)), abs=NEAR)
    assert rag.hausdorff == pytest.approx(np.max(brute(sim, real, 2)), abs=NEAR)
    both = (np.mean(brute(sim, real, 2)) + np.mean(brute(real, sim, 2))) / 2
    assert metrics.symmetric_distance(sim, real) == pytest.approx(both, abs=NEAR)


def test_by_hand():
    sim = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    real = np.array([[0.3, 0.4, 0.0], [1.0, 0.0, 1.2], [9.0, 0.0, 0.0]])
    # Sim to real: 0.7 and min(0.7 + 0.4, 1.2, 8); by Euclid 0.5 and min(0.806, 1.2, 8).
    rag = metrics.rag_distances(sim, real)
    assert rag.chamfer == pytest.approx((0.7 + 1.1) / 2)
    assert rag.hausdorff == pytest.approx((0.49 + 0.16) ** 0.5)
    # Real to sim: 0.5, 1.2 and 8.
    there, back = (0.5 + 0.65**0.5) / 2, (0.5 + 1.2 + 8.0) / 3
    assert metrics.symmetric_distance(sim, real) == pytest.approx((there + back) / 2)
    assert metrics.symmetric_distance(sim, sim) == 0.0


def test_manhattan_and_euclid_may_find_other_neighbors():
    sim = np.zeros((1, 3))
    real = np.array([[0.5, 0.5, 0.5], [1.2, 0.0, 0.0]])  # 1.5 and 1.2 by Manhattan, .87 and 1.2.
    rag = metrics.rag_distances(sim, real)
    assert rag.chamfer == pytest.approx(1.2)
    assert rag.hausdorff == pytest.approx(0.75**0.5)


def test_jitter_of_what_is_known():
    step, frames = 0.01, 20
    times = np.arange(frames) * step
    still = np.zeros((frames, 5, 3)) + np.linspace(0.0, 1.0, 5)[:, None]
    assert metrics.jitter(still, step) == 0.0
    moving = still + times[:, None, None] * [0.3, 0.0, -0.1]
    assert metrics.jitter(moving, step) == pytest.approx(0.0, abs=1e-9)
    falling = still + times[:, None, None] ** 2 / 2 * [0.0, 0.0, -9.81]
    assert metrics.jitter(falling, step) == pytest.approx(9.81)
    restless = still.copy()
    restless[::2, 0, 2] += 1e-4  # One of five, by 0.1 mm each frame: 4 (0.1 mm) / 2 / (10 ms)^2.
    assert metrics.jitter(restless, step) == pytest.approx(2e-4 / step**2 / 5)


GOOD = np.zeros((4, 3))


@pytest.mark.parametrize("bad", [np.zeros((0, 3)), np.zeros((4, 2)), np.zeros(3), GOOD * np.nan])
@pytest.mark.parametrize("measure", [metrics.rag_distances, metrics.symmetric_distance])
def test_no_cloud_is_refused(measure, bad):
    for clouds_given in ((bad, GOOD), (GOOD, bad)):
        with pytest.raises(InvalidArgumentError, match=r"simulated|real|first|second"):
            measure(*clouds_given)


@pytest.mark.parametrize(
    ("positions", "step"),
    [
        (np.zeros((2, 4, 3)), 0.01),
        (np.zeros((5, 0, 3)), 0.01),
        (np.zeros((5, 3)), 0.01),
        (np.zeros((5, 4, 3)), 0.0),
        (np.zeros((5, 4, 3)), np.nan),
        (np.full((5, 4, 3), np.inf), 0.01),
    ],
)
def test_no_motion_is_refused(positions, step):
    with pytest.raises(InvalidArgumentError, match=r"positions|step"):
        metrics.jitter(positions, step)
