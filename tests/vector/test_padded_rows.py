"""Rows of many arrays of different sizes, and distances of the vertices of many meshes."""

import numpy as np
import pytest

from softgym_mj.batch.device import CpuDevice
from softgym_mj.entities.mesh_distances import MeshDistances
from softgym_mj.tasks.shared.state import stack
from softgym_mj.vector.batch.distance_tables import DistanceTables
from softgym_mj.vector.batch.padded_rows import PaddedRows
from tests.native.torch_device import TorchDevice

DEVICES = {"NumPy": CpuDevice, "PyTorch": TorchDevice}


def _rows(number, seed):
    random = np.random.default_rng(seed)
    return [
        {
            "a": random.normal(size=random.integers(0, 9, 2)),
            "b": {"c": i, "d": random.integers(9, size=random.integers(1, 9))},
        }
        for i in range(number)
    ]


@pytest.mark.parametrize("device", DEVICES)
def test_many_rows_are_padded_like_a_stack(device):
    first, second = _rows(150, 0), _rows(100, 1)
    rows = PaddedRows(1, DEVICES[device]())
    rows.put_all(0, first)
    rows.put_all(120, second)  # Replaces 30 rows.
    expected = stack([*first[:120], *second])
    found = rows.whole
    for own, other in ((found["a"], expected["a"]), (found["b"]["d"], expected["b"]["d"])):
        assert len(own) == 256
        np.testing.assert_array_equal(own[:220], other)
        assert not own[220:].any()
    assert found["b"]["c"].tolist() == [*range(120), *range(100), *[0] * 36]


def _squares(number, length):
    """A row of unit squares, without diagonals."""
    side = [(i, i + 1) for i in range(number)]
    edges = [*side, *((a + number + 1, b + number + 1) for a, b in side)]
    edges += [(i, i + number + 1) for i in range(number + 1)]
    return MeshDistances(2 * number + 2, np.array(edges), np.full(len(edges), length))


@pytest.mark.parametrize("device", DEVICES)
def test_distances_of_many_meshes(device):
    """Vertices in columns i and j have distance |i - j|, or one more in the other row."""
    device = DEVICES[device]()
    tables = DistanceTables(device)
    lengths = [2, 5, 3, 8, 2, 4]
    meshes = [_squares(n, 0.5 * n).pairs for n in lengths]
    assert meshes[1].distances.tolist() == [2.5 * i for i in range(7)]
    first = [tables.add(bytes([n]), *mesh) for n, mesh in zip(lengths, meshes, strict=True)]
    assert first[0] == first[4] and len({*first}) == 5
    for a in (0, 2, 4):
        for b in (1, 3, 5):
            columns = [(a % (n + 1), b % (n + 1)) for n in lengths]
            steps = [
                abs(i - j) + int((a > n) != (b > n))
                for (i, j), n in zip(columns, lengths, strict=True)
            ]
            vertices = (device.put(np.full(6, each)) for each in (a, b))
            found = tables.between(device.put(np.array(first)), *vertices)
            assert found.tolist() == [
                0.5 * n * step for n, step in zip(lengths, steps, strict=True)
            ]


def test_distances_of_unconnected_vertices_are_infinite():
    pairs = MeshDistances(3, np.array([(0, 1)]), np.array([2.0])).pairs
    assert pairs.distances[pairs.indices].tolist() == [0.0, 2.0, 0.0, np.inf, np.inf, 0.0]
