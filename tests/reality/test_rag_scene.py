"""The scene of the rags against what is published of it."""

import numpy as np
import pytest

from softgym_mj.cloth import fabrics
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import primitives, rag_scene
from softgym_mj.reality.rag_scene import corners, hands, hung, rag, replay_rag


def test_a_rag_hangs_from_the_open_grippers():
    mesh = rag()
    assert 400 < len(mesh.points) < 450  # The benchmark's mesh has 402.
    np.testing.assert_allclose(mesh.strain(hung(mesh)), 0.0, atol=1e-4)
    np.testing.assert_allclose(
        hung(mesh)[list(corners(mesh))], [[0.009, 0.0, 1.0], [0.509, 0.0, 1.0]], atol=1e-12
    )
    assert hung(mesh)[:, 2].min() == pytest.approx(1.0 - rag_scene.LENGTH)


@pytest.mark.parametrize("primitive", primitives.PIECES)
def test_grippers_settle_move_together_and_wait(primitive):
    path = hands(primitive)(np.array([-9.0, -3.0, -2.0, -1.5, -1.0, -0.01, 0.0]))
    np.testing.assert_allclose(path[:, :, 1:], np.array(primitives.START) + np.zeros((7, 2, 2)))
    apart = path[:, 1, 0] - path[:, 0, 0]
    np.testing.assert_allclose(apart, [0.5, 0.5, 0.5, 0.489, 0.478, 0.478, 0.478])
    np.testing.assert_allclose(path[..., 0].mean(axis=1), 0.259)
    later = np.linspace(0.0, primitives.duration(primitive), 50)
    expected = primitives.gripper_positions(primitive, later)
    np.testing.assert_array_equal(hands(primitive)(later), expected)


def test_the_published_samples_stop_for_a_step():
    times = np.arange(442) * 0.01
    path = hands("dynamic", published=True)(times)
    np.testing.assert_allclose(path, primitives.published_positions("dynamic"), atol=1e-9)
    halves = hands("dynamic", published=True)(times[:-1] + 0.005)
    np.testing.assert_allclose(halves, (path[1:] + path[:-1]) / 2, atol=1e-9)
    assert np.diff(path[:, 0, 1])[110] == pytest.approx(0.0, abs=1e-9)


def test_no_primitive_is_refused():
    with pytest.raises(InvalidArgumentError, match="primitive"):
        hands("fling")


def test_a_hung_rag_bears_its_weight():
    """In a sheet that hangs still the integral over its area of the stress along Z is its weight
    times the distance of its centre of mass below the grips: the virial theorem.
    """
    fabric = Fabric.named("pink_ribbon")
    mesh = rag()
    positions = replay_rag(fabric, "dynamic", np.array([-0.01])).positions[0]
    drop = primitives.START[1] - positions[:, 2].mean()
    weight = fabric.density * mesh.area * fabrics.GRAVITY
    assert 0.9 * weight * drop < virial(mesh, fabric, positions) < 1.1 * weight * drop


def virial(mesh, fabric, positions):
    """Sum over edges of the product of force along Z and extent along Z [J]."""
    across = positions[mesh.edges[:, 1]] - positions[mesh.edges[:, 0]]
    lengths = np.linalg.norm(across, axis=1)
    number = {tuple(edge): i for i, edge in enumerate(mesh.edges)}
    areas, counts = np.zeros(len(mesh.edges)), np.zeros(len(mesh.edges))
    for triangle in mesh.triangles:
        a, b, c = mesh.points[triangle]
        for i in range(3):
            edge = number[tuple(sorted((triangle[i], triangle[(i + 1) % 3])))]
            areas[edge] += np.linalg.norm(np.cross(b - a, c - a)) / 2
            counts[edge] += 1
    # As the solver has them: by area and length, and diagonals softer.
    share = areas / mesh.lengths**2
    stiffness = fabric.material()["stretch"] / 1.2 * share
    stiffness[(share < 0.75) & (counts == 2)] *= fabric.shear
    force = stiffness * (lengths - mesh.lengths)
    return float(np.sum(force * across[:, 2] ** 2 / lengths))


def test_a_rag_bends_when_its_corners_come_together():
    """Its upper edge is as long as before, and not compressed to 0.478 m."""
    mesh = rag()
    positions = replay_rag(Fabric.named("black_denim"), "dynamic", np.array([-0.01])).positions[0]
    left, right = corners(mesh)
    edge = positions[left : right + 1]
    length = np.linalg.norm(np.diff(edge, axis=0), axis=1).sum()
    assert 0.495 < length < 0.51
    assert np.percentile(mesh.strain(positions), 1) > -0.02
