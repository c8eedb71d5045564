"""Measures of `benchmarks.peers`, and a case of this package."""

import math

import numpy as np
import pytest

from benchmarks.peers.__main__ import case, played
from benchmarks.peers.scene import Scene
from benchmarks.peers.softgym_cloth import SoftGymCloth


def test_layers_and_neighbors():
    scene = Scene(9, 5)
    points = scene.points()
    assert scene.smallest_gap(points) == math.inf  # One layer.
    top = points[:, 2] > points[:, 2].mean() + 1e-9
    points[top, 2] = 2.0 * points[:, 2].mean() - points[top, 2]  # Folded, 3 mm apart.
    points[top, 0] = 0.003
    assert scene.smallest_gap(points) == pytest.approx(0.003)
    assert scene.intersections(points) == 0


def test_strains_of_a_cloth_stretched_by_a_tenth():
    scene = Scene(9, 5)
    np.testing.assert_allclose(scene.strains(1.1 * scene.points(0.3)), 0.1)


def test_a_cloth_of_the_package_falls_from_its_corners_to_rest():
    scene = Scene(9, 5)
    simulation = SoftGymCloth(scene, 2, "cpu")
    starts = scene.starts(2)
    np.testing.assert_allclose(simulation.positions(2), starts, atol=1e-12)
    for _ in range(10):
        simulation.step()
    held = list(scene.held)
    np.testing.assert_allclose(simulation.positions(2)[:, held], starts[:, held], atol=1e-9)
    simulation.restart()
    results = played(simulation, scene, 2, 60.0)
    assert results["simulated_s"] == 2.0
    assert results["problems"] == []
    assert results["intersections"] == 0
    assert results["largest_strain"] < 0.1
    assert results["floor_penetration_mm"] < 0.1
    assert results["final_speed_mm_per_s"] < 1.0
    assert results["final_mean_height_mm"] < 20.0


def test_a_case_ends_early_with_the_rates_until_then():
    found = case("softgym_mj", "9x5", 1, "cpu", 1e-9)
    assert found["simulated_s"] == 0.01
    assert found["vertex_substeps_per_s"] == pytest.approx(found["steps_per_s"] * 25 * 45, 1e-3)
