"""What the benchmarks of this room simulate: the T-shirt's mesh, stock MuJoCo's sheet, the runs."""

import collections

import numpy as np
import pytest

from benchmarks import rags, shirts, stock_flex
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.replay import Hold


@pytest.mark.parametrize("finer", [1, 2])
def test_a_shirt_is_a_tube_with_sleeves(finer):
    mesh = shirts.shirt(finer)
    # A sphere with four holes: hem, neck and two sleeves.
    assert len(mesh.points) - len(mesh.edges) + len(mesh.triangles) == 2 - 4
    sides = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    counts = collections.Counter(map(tuple, sides.tolist()))
    assert set(counts.values()) == {1, 2}
    # Triangles that share an edge run along it in opposite directions.
    directed = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert count_intersections(mesh.points, mesh.edges, mesh.triangles) == 0
    assert np.ptp(mesh.points[:, 0]) == pytest.approx(16 * shirts.UNIT)
    upper = mesh.triangles[mesh.points[mesh.triangles][..., 2].mean(axis=1) > 0.0]
    a, b, c = (mesh.points[upper[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0.0).all()


@pytest.mark.parametrize("action", shirts.ACTIONS)
def test_hands_start_where_the_shirt_lies(action):
    mesh = shirts.shirt(1)
    holds, end = shirts.ACTIONS[action](mesh, mesh.points)
    (hold,) = holds
    places = hold.path(np.linspace(0.0, end, 200))
    np.testing.assert_allclose(places[0], mesh.points[list(hold.vertices)], atol=1e-12)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=2).max() * 199 / end
    assert speed < 1.0  # [m/s]
    assert places[..., 2].min() > -1e-9


@pytest.mark.parametrize(
    "flex",
    [
        stock_flex.Flex.shell(1000.0, 1e-5, 0.5, 0.01),
        stock_flex.Flex.published(85242.02, 5e-4, 0.4, 1.0),
    ],
    ids=["shell", "published"],
)
def test_stock_mujoco_holds_and_drops(flex):
    mesh = rectangle(0.15, 0.09, 0.03)
    start = mesh.points[:, [0, 2, 1]] + [0.0, 0.0, 0.5]

    def path(times):
        return start[[0, 5]] + np.asarray(times)[:, None, None] * [0.0, 0.1, 0.0]

    times = np.array([0.0, 0.2, 0.4])
    found = stock_flex.replay(
        mesh, flex, 0.2 * mesh.area, Hold((0, 5), path), times, start=start, begin=0.0, floor=0.3
    )
    np.testing.assert_allclose(found.positions[0], start, atol=1e-6)
    np.testing.assert_allclose(found.positions[-1, [0, 5]], path(times[-1:])[0], atol=0.01)
    assert 0.4 < found.positions[-1, :, 2].min() < 0.5
    assert len(found.steps.times) == 40
    assert not found.failures


def test_sixty_runs_of_each_engine():
    keys = [*rags.cases()]
    assert len(set(keys)) == len(keys)
    counts = collections.Counter(key[0] for key in keys)
    assert counts == {"ours": 60, "ours_woven": 60, "shell_10ms": 60, "shell_2ms": 2, "fitted": 12}
    for engine, stretch in (("ours", 51.0), ("ours_woven", 1000.0)):
        fabric = rags.fabric_of(engine, "gray_interlock", 150)
        assert (fabric.density, fabric.stretch_stiffness) == (0.15, stretch)
