"""The scene of the rags against what is published of it, and hanging rags against statics."""

import numpy as np
import pytest

from softgym_mj.cloth import fabrics
from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality import primitives
from softgym_mj.reality.identification.rag_data import SIZE, RagScene
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.rag_scene import corners, hung

WIDE = (0.50, 0.63)  # [m] Width of the benchmark's mesh: wider than the grippers are apart.
SPACING = 0.028  # [m]


def test_a_rag_hangs_from_the_open_grippers():
    mesh = rectangle(*WIDE, SPACING)
    np.testing.assert_allclose(mesh.strain(hung(mesh)), 0.0, atol=1e-4)
    np.testing.assert_allclose(
        hung(mesh)[list(corners(mesh))], [[0.009, 0.0, 1.0], [0.509, 0.0, 1.0]], atol=1e-12
    )
    assert hung(mesh)[:, 2].min() == pytest.approx(1.0 - WIDE[1])


def test_a_hung_rag_bears_its_weight():
    """Compares the stress in a sheet that hangs still with the virial theorem.

    The integral over its area of the stress along Z is its weight times the distance of its center
    of mass below the grips.
    """
    fabric = Fabric.named("pink_ribbon")
    scene = RagScene("quasi_static", 0.01, SIZE, SPACING)
    positions = scene.motion(fabric).positions[0]
    middle = scene.mesh.vertex_areas @ positions[:, 2] / scene.mesh.area
    drop = primitives.START[1] - middle
    weight = fabric.density * scene.mesh.area * fabrics.GRAVITY
    assert 0.9 * weight * drop < virial(scene.mesh, fabric, positions) < 1.1 * weight * drop


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
    scene = RagScene("dynamic", 0.01, WIDE, SPACING)
    positions = scene.motion(Fabric.named("black_denim")).positions[0]
    left, right = corners(scene.mesh)
    edge = positions[left : right + 1]
    length = np.linalg.norm(np.diff(edge, axis=0), axis=1).sum()
    assert 0.495 < length < 0.51
    assert np.percentile(scene.mesh.strain(positions), 1) > -0.02
