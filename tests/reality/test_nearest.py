"""Distances from a surface against a slow reference: all triangles, by minimization."""

import numpy as np
import pytest
from scipy.optimize import minimize

from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.nearest import SurfaceDistance


def reference(point, corners):
    """Distance of a point (3,) from a triangle (3, 3): the least over its barycentric places."""
    best = np.inf
    for start in ((1 / 3, 1 / 3), (0.8, 0.1), (0.1, 0.8), (0.1, 0.1)):
        found = minimize(
            lambda v: np.sum(
                (corners[0] + v[0] * (corners[1] - corners[0]) + v[1] * (corners[2] - corners[0])
                 - point) ** 2
            ),
            start,
            bounds=[(0.0, 1.0), (0.0, 1.0)],
            constraints={"type": "ineq", "fun": lambda v: 1.0 - v[0] - v[1]},
            method="SLSQP",
            options={"ftol": 1e-15},
        )  # fmt: skip
        best = min(best, float(np.sqrt(found.fun)))
    return best


def test_of_one_triangle_it_is_the_least_over_its_points():
    random = np.random.default_rng(3)
    distance = SurfaceDistance(np.array([[0, 1, 2]]))
    for _ in range(20):
        corners, point = random.normal(size=(3, 3)), random.normal(size=3)
        found = distance(point[None], corners)[0]
        assert found == pytest.approx(reference(point, corners), abs=1e-6)
        displacement = distance.displacements(point[None], corners)[0]
        assert np.linalg.norm(displacement) == pytest.approx(found, abs=1e-12)
        assert reference(point - displacement, corners) == pytest.approx(0.0, abs=1e-6)


def test_over_a_grid_it_is_the_height_and_beside_it_that_from_the_edge():
    mesh = rectangle(0.3, 0.2, 0.05)
    random = np.random.default_rng(4)
    points = random.uniform([-0.15, -0.1, -0.1], [0.15, 0.1, 0.1], size=(200, 3))
    distance = SurfaceDistance(mesh.triangles)
    np.testing.assert_allclose(distance(points, mesh.points), np.abs(points[:, 2]), atol=1e-12)
    beside = np.array([[0.25, 0.0, 0.0], [0.15, 0.1, 0.3], [0.18, 0.14, 0.0]])
    np.testing.assert_allclose(distance(beside, mesh.points), [0.1, 0.3, 0.05], atol=1e-12)


def test_it_moves_with_the_mesh():
    mesh = rectangle(0.3, 0.2, 0.05)
    lifted = mesh.points + [0.0, 0.0, 0.4]
    assert SurfaceDistance(mesh.triangles)(np.zeros((1, 3)), lifted)[0] == pytest.approx(0.4)
