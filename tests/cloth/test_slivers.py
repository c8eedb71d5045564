"""Meshes with slim triangles: these touch later than others, and nothing else changes."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial import Delaunay

from softgym_mj.batch.device import CpuDevice
from softgym_mj.cloth.batch_solver import ClothBatchSolver, describe
from tests.cloth.flex_scene import TIMESTEP, WOVEN, Flex, FlexScene, sheet

SPACING, RADIUS, COUNT = 0.02, 0.0025, 21  # [m], [m], vertices along a side.


def _sheet(count=COUNT):
    return sheet(count, count, SPACING, WOVEN, radius=RADIUS, center=(0.0, 0.0, RADIUS))


def with_sliver_at_the_rim(height: float) -> Flex:
    """A sheet with one more triangle of this height [m] on an edge of its rim."""
    flex = _sheet()
    a, b = COUNT // 2, COUNT // 2 + 1
    apex = (flex.points[a] + flex.points[b]) / 2.0 - [0.0, height, 0.0]
    triangles = np.vstack([flex.elements, [a, len(flex.points), b]])
    return dataclasses.replace(flex, points=np.vstack([flex.points, apex]), elements=triangles)


def with_sliver_inside(height: float) -> Flex:
    """A sheet with a vertex at this height [m] over the middle of an inner edge."""
    flex = _sheet()
    points, triangles, at = flex.points, flex.elements, len(flex.elements) // 2 + 5
    a, b, c = triangles[at]
    along, across = points[b] - points[a], points[c] - (points[a] + points[b]) / 2.0
    across = across - along * (across @ along) / (along @ along)
    apex = (points[a] + points[b]) / 2.0 + height * across / np.linalg.norm(across)
    n = len(points)
    triangles = np.vstack([np.delete(triangles, at, 0), [a, b, n], [b, c, n], [c, a, n]])
    return dataclasses.replace(flex, points=np.vstack([points, apex]), elements=triangles)


def irregular(seed: int, count: int = 350, size: float = 0.36) -> Flex:
    """A square sheet with so many vertices at random: a fifth of the triangles are slim."""
    side = np.linspace(0.0, size, 18)
    rim = [[x, y] for x in side for y in (0.0, size)] + [
        [x, y] for x in (0.0, size) for y in side[1:-1]
    ]
    points = np.vstack([rim, np.random.default_rng(seed).uniform(0.0, size, (count, 2))])
    triangles = Delaunay(points).simplices
    u, v = (points[triangles[:, i]] - points[triangles[:, 0]] for i in (1, 2))
    # Qhull also returns triangles without an area along the rim.
    triangles = triangles[u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 1e-7]
    flat = np.column_stack([points - size / 2.0, np.full(len(points), RADIUS)])
    mass = WOVEN.density * size**2
    return dataclasses.replace(_sheet(), points=flat, elements=triangles, mass=mass)


def heights(flex: Flex) -> np.ndarray:
    """The smallest height of each triangle [m]."""
    corners = flex.points[flex.elements]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(normals, axis=1) / sides.max(axis=1)


def standing(flex: Flex) -> FlexScene:
    """The sheet, wavy, on its rim."""
    scene = FlexScene(flex)
    x, y = flex.points[:, :2].T
    waves = 0.02 * np.sin(40.0 * y) + 0.01 * np.cos(25.0 * x)
    upright = np.column_stack([x, waves, y - y.min() + 0.015])
    scene.data.qpos[:] += (upright - scene.positions()).ravel()
    return scene


@pytest.mark.parametrize(
    ("make", "height"),
    [
        pytest.param(with_sliver_at_the_rim, 1e-3, marks=pytest.mark.long),
        pytest.param(with_sliver_at_the_rim, 1e-4, marks=pytest.mark.long),
        pytest.param(with_sliver_inside, 3e-3, marks=pytest.mark.long),
        (with_sliver_inside, 4e-4),
    ],
)
def test_a_sheet_with_a_sliver_does_not_cross_itself(make, height):
    flex = make(height)
    assert heights(flex).min() < 1.01 * height
    scene = standing(flex)
    scene.step(round(2.0 / TIMESTEP))
    assert scene.hits == 0
    assert np.ptp(scene.positions()[:, 1]) < 0.2  # It fell upon itself: it was 0.4 m high.


def test_a_sheet_of_many_slivers_does_not_cross_itself():
    flex = irregular(1)
    assert (heights(flex) < 2.0 * RADIUS).mean() > 0.15
    scene = standing(flex)
    scene.step(round(2.0 / TIMESTEP))
    assert scene.hits == 0
    assert np.abs(scene.strain()).max() < 0.1


def test_nothing_pushes_in_a_flat_sheet_of_slivers():
    flex = irregular(2)
    scene = FlexScene(flex, floor=False, gravity=(0.0, 0.0, 0.0))
    scene.step(20)
    np.testing.assert_allclose(scene.positions(), flex.points, atol=1e-7)


def test_layers_rest_a_thickness_apart_at_a_sliver():
    lower, upper = with_sliver_inside(1e-4), _sheet(11)
    n = len(lower.points)
    points = np.vstack([lower.points, upper.points + [0.003, 0.004, 0.01]])
    both = dataclasses.replace(
        lower,
        points=points,
        elements=np.vstack([lower.elements, upper.elements + n]),
        mass=lower.mass * len(points) / n,
    )
    scene = FlexScene(both)
    scene.step(100)
    np.testing.assert_allclose(scene.positions()[n:, 2], 3.0 * RADIUS, atol=1e-4)


@pytest.mark.parametrize("turns", [0, 3])
def test_environments_of_slivers_have_the_bits_of_the_plugin(turns):
    scene = standing(irregular(0))
    count = len(scene.positions())
    solver = ClothBatchSolver(1, count, 0, CpuDevice(turns=turns))
    solver.start(0, describe(scene.model, [], room=4.0))
    solver.qpos[0] = scene.data.qpos.reshape(-1, 3)
    nothing = np.zeros((1, 0, 3))
    for _ in range(60):
        scene.step()
        solver.step(nothing, np.zeros((1, 0), np.int32), nothing)
        np.testing.assert_array_equal(solver.qpos[0], scene.data.qpos.reshape(-1, 3))
    assert solver.flags[0] == 0
    assert (solver.after_layers[..., 0] != 0).sum() > 5  # Layers pushed.
