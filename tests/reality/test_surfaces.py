"""Samples of surfaces against closed forms, and what is seen against rays and triangles."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import surfaces
from softgym_mj.rendering.calibration import Calibration

SIZE = 120, 160  # [pixels]


def equilateral(side):
    return np.array([[0.0, 0.0, 0.0], [side, 0.0, 0.0], [side / 2, side * 3**0.5 / 2, 0.0]])


def grid(rows, columns, spacing):
    """A flat mesh of two triangles a cell."""
    y, x = np.mgrid[:rows, :columns]
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * spacing
    i = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, :-1], i[1:, 1:]))
    return vertices, np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])


@pytest.mark.parametrize(("side", "parts"), [(0.03, 6), (0.032, 7), (0.004, 1), (0.0051, 2)])
def test_samples_of_a_triangle_are_a_triangular_number(side, parts):
    vertices, triangles = equilateral(side), np.array([[0, 1, 2]])
    points = surfaces.sample_surface(vertices, triangles).points(vertices)
    assert len(points) == (parts + 1) * (parts + 2) // 2
    nearest = cKDTree(points).query(points, k=2)[0][:, 1]
    np.testing.assert_allclose(nearest, side / parts)
    # What is farthest from a lattice of equilateral triangles are their middles.
    dense = surfaces.sample_surface(vertices, triangles, side / parts / 30).points(vertices)
    farthest = cKDTree(points).query(dense)[0].max()
    assert farthest == pytest.approx(side / parts / 3**0.5)


def test_a_grid_of_half_the_spacing_is_itself_and_shared_points_are_there_once():
    vertices, triangles = grid(4, 5, 0.0025)
    points = surfaces.sample_surface(vertices, triangles).points(vertices)
    np.testing.assert_array_equal(points, vertices)
    vertices, triangles = grid(4, 5, 0.01)  # Diagonals of 1.41 cm have 3 parts, sides 2.
    points = surfaces.sample_surface(vertices, triangles).points(vertices)
    sides, diagonals, cells = 4 * 4 + 3 * 5, 12, 24
    assert len(points) == 20 + sides * 1 + diagonals * 2 + cells * 1
    assert len(np.unique(points.round(9), axis=0)) == len(points)


def test_nothing_of_a_surface_is_far_from_a_sample():
    rng = np.random.default_rng(3)
    vertices, triangles = rng.normal(size=(30, 3)) * 0.05, rng.integers(0, 30, (40, 3))
    triangles = triangles[[len(set(corners)) == 3 for corners in triangles.tolist()]]
    points = surfaces.sample_surface(vertices, triangles).points(vertices)
    weights = rng.dirichlet([1.0, 1.0, 1.0], 20_000)
    anywhere = vertices[triangles[rng.integers(0, len(triangles), 20_000)]]
    anywhere = np.einsum("nk,nkx->nx", weights, anywhere)
    assert cKDTree(points).query(anywhere)[0].max() <= surfaces.SPACING


def test_samples_move_with_vertices_and_are_always_the_same():
    vertices, triangles = grid(3, 3, 0.02)
    samples = surfaces.sample_surface(vertices, triangles)
    again = surfaces.sample_surface(vertices, triangles)
    np.testing.assert_array_equal(samples.corners, again.corners)
    np.testing.assert_array_equal(samples.weights, again.weights)
    turned = vertices @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) + 0.3
    moved = samples.points(vertices) @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]) + 0.3
    np.testing.assert_allclose(samples.points(turned), moved)


def looking_down(height=1.0, focal=100.0):
    """A camera over the origin; its image's columns are X, its rows -Y."""
    extrinsics = np.diag([1.0, -1.0, -1.0, 1.0])
    extrinsics[2, 3] = height
    middle = (SIZE[1] - 1) / 2, (SIZE[0] - 1) / 2
    return Calibration(
        np.array([[focal, 0.0, middle[0]], [0.0, focal, middle[1]], [0.0, 0.0, 1.0]]), extrinsics
    )


def unhidden(points, vertices, triangles, origin):
    """Returns which points no triangle occludes, by Moeller and Trumbore's equations of rays."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    answer = []
    for point in points:
        ray = np.broadcast_to(point - origin, a.shape)
        matrices = np.stack([b - a, c - a, -ray], axis=2)
        u, v, t = np.linalg.solve(matrices, (origin - a)[..., None])[..., 0].T
        before = (1.0 - t) * abs(point[2] - origin[2]) > surfaces.CLEARANCE
        answer.append(not np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & before))
    return np.array(answer)


def test_of_two_sheets_the_upper_one_hides_its_shadow():
    lower, triangles = grid(21, 21, 0.02)
    lower[:, :2] -= 0.2
    upper = lower * [0.5, 0.5, 1.0] + [0.0, 0.0, 0.5]  # Half as wide at half the distance: all.
    both = np.concatenate([triangles, triangles + len(lower)])
    camera = looking_down()
    assert surfaces.seen(lower, lower, triangles, camera, SIZE).all()
    visible = surfaces.seen(lower, np.concatenate([lower, upper]), both, camera, SIZE)
    assert not visible.any()
    upper[:, 0] += 0.05  # 10 cm on the lower one: five columns are free.
    stacked = np.concatenate([lower, upper])
    visible = surfaces.seen(stacked, stacked, both, camera, SIZE)
    columns = np.round((lower[:, 0] + 0.2) / 0.02).astype(int)
    np.testing.assert_array_equal(visible[:441][columns != 5], (columns < 5)[columns != 5])
    assert visible[441:].all()


def test_what_is_seen_of_a_pile_is_what_rays_reach():
    rng = np.random.default_rng(5)
    vertices, triangles = grid(9, 9, 0.05)
    vertices[:, :2] -= 0.2
    vertices[:, 2] = rng.uniform(0.0, 0.5, len(vertices))
    vertices[:, :2] += rng.normal(size=(len(vertices), 2)) * 0.04
    samples = surfaces.sample_surface(vertices, triangles, 0.06).points(vertices)
    visible = surfaces.seen(samples, vertices, triangles, looking_down(), SIZE)
    expected = unhidden(samples, vertices, triangles, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(visible, expected)
    assert 0.2 < visible.mean() < 0.95


def test_what_is_beside_the_image_or_behind_the_camera_is_not_seen():
    vertices, triangles = grid(2, 2, 0.1)
    edge = 160 / 2 / 100  # [m] Half of the image's width at a meter.
    points = np.array([[edge - 1e-6, 0, 0], [edge + 1e-6, 0, 0], [0, 0, 2.0], [0, 0, 1.0]])
    visible = surfaces.seen(points, vertices, triangles, looking_down(), SIZE)
    assert visible.tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"vertices": np.zeros((4, 2))}, "vertices"),
        ({"vertices": np.full((4, 3), math.nan)}, "vertices"),
        ({"triangles": np.zeros((0, 3), int)}, "triangles"),
        ({"triangles": np.zeros((2, 3))}, "triangles"),
        ({"triangles": np.array([[0, 1, 4]])}, "triangles"),
        ({"spacing": 0.0}, "spacing"),
    ],
)
def test_no_mesh_is_refused(change, name):
    vertices, triangles = grid(2, 2, 0.1)
    arguments = {"vertices": vertices, "triangles": triangles, **change}
    with pytest.raises(InvalidArgumentError, match=name):
        surfaces.sample_surface(**arguments)


def test_a_mesh_behind_the_camera_is_refused():
    vertices, triangles = grid(2, 2, 0.1)
    with pytest.raises(InvalidArgumentError, match="in front of the camera"):
        surfaces.seen(vertices, vertices + [0, 0, 2.0], triangles, looking_down(), SIZE)
