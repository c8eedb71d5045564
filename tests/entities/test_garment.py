"""A garment from a mesh file moves as the cloth of the same mesh, and bad meshes are errors."""

import pathlib
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from softgym_mj import assets, metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.fabric import AREA_DENSITY, THICKNESS, Fabric
from softgym_mj.entities.garment import Garment
from softgym_mj.robots.base import SIM_STEP
from tests.scenes.alone import compiled

RADIUS = THICKNESS / 2.0  # [m]

T_SHIRT = assets.path("garments/t_shirt.obj")
TOOL = pathlib.Path(__file__).parents[2] / "tools" / "t_shirt.py"
SQUARE = "v 0 0 0\nv .03 0 0\nv .03 .03 0\nv 0 .03 0\n"


def obj(path, points, triangles):
    """Writes an OBJ file."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += ["f {} {} {}".format(*triangle) for triangle in (triangles + 1).tolist()]
    path.write_text("\n".join(lines))
    return path


class Scene:
    """A sheet on the floor."""

    def __init__(self, sheet, start):
        self.sheet, self.physics = sheet, compiled(sheet)
        self.crossings = self._count = 0
        sheet.set_points(start)

    def step(self, count=1):
        for _ in range(count):
            mujoco.mj_step(self.physics.model.ptr, self.physics.data.ptr)
            self._count += 1
            if self._count % 10 == 0:
                self.crossings = max(self.crossings, self.sheet.intersections())

    def lift(self, vertex, height, speed=0.6):
        """Carries a vertex up by `height` [m]."""
        self.sheet.hold(vertex)
        goal = self.sheet.vertex(vertex)
        for _ in range(round(height / speed / SIM_STEP)):
            goal = goal + [0.0, 0.0, speed * SIM_STEP]
            self.sheet.drive(vertex, goal, SIM_STEP)
            self.step()


def test_a_grid_from_a_file_moves_bit_by_bit_as_a_cloth(tmp_path):
    # A mesh file has float32 numbers: vertices 1/32 m apart are exact.
    cloth = Cloth(dims=(41, 41))
    flat = cloth.flat()
    file = obj(tmp_path / "grid.obj", flat - [0.0, 0.0, RADIUS], cloth.triangles)
    garment = Garment(file)
    np.testing.assert_array_equal(garment.laid(), flat)
    np.testing.assert_array_equal(garment.triangles, cloth.triangles)
    ways = []
    for sheet in (cloth, garment):
        scene = Scene(sheet, flat)
        scene.lift(0, 0.2)
        way = [sheet.points()]
        sheet.release_all()
        for _ in range(5):
            scene.step(10)
            way.append(sheet.points())
        ways.append(way)
    np.testing.assert_array_equal(*ways)
    assert np.ptp(ways[0][0][:, 2]) > 0.15  # It was lifted.


def test_mass_and_size_follow_density_and_scale():
    small = Garment(T_SHIRT)
    large = Garment(T_SHIRT, scale=1.5, fabric=Fabric(density=0.1, thickness=0.015))
    assert large.area == pytest.approx(2.25 * small.area, rel=1e-6)
    np.testing.assert_allclose(np.ptp(large.laid(), axis=0), 1.5 * np.ptp(small.laid(), axis=0))
    for garment, density in ((small, AREA_DENSITY), (large, 0.1)):
        model = Scene(garment, garment.laid()).physics.model.ptr
        bodies = [model.body(f"garment/flex_{i}").id for i in range(garment.num_points)]
        assert model.body_mass[bodies].sum() == pytest.approx(density * garment.area, rel=1e-6)


def test_laid_is_a_rigid_motion_onto_the_floor():
    garment = Garment(T_SHIRT)
    flat, turned = garment.laid(), garment.laid((0.2, -0.1), np.pi / 2)
    assert flat[:, 2].min() == pytest.approx(RADIUS, abs=1e-12)
    assert (flat.min(axis=0) + flat.max(axis=0))[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    # A quarter turn takes X to Y and Y to -X.
    expected = np.column_stack([0.2 - flat[:, 1], flat[:, 0] - 0.1, flat[:, 2]])
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_the_t_shirt_rests_on_the_floor_in_two_layers():
    shirt = Garment(T_SHIRT)
    scene = Scene(shirt, shirt.laid())
    scene.step(100)
    heights = shirt.points()[:, 2]
    back = shirt.laid()[:, 2] < RADIUS + 1e-3
    np.testing.assert_allclose(heights[back], RADIUS, atol=1e-3)
    assert np.median(heights[~back]) == pytest.approx(3 * RADIUS, abs=1e-3)
    assert np.abs(shirt.edge_strain()).max() < 0.02
    assert scene.crossings == 0


def test_a_dropped_t_shirt_crumples_without_crossing_itself():
    shirt = Garment(T_SHIRT)
    scene = Scene(shirt, shirt.laid())
    scene.lift(int(np.argmax(shirt.points()[:, 0])), 0.45)  # The end of a sleeve.
    assert np.percentile(shirt.edge_strain(), 99) < 0.15
    shirt.release_all()
    scene.step(150)
    assert scene.crossings == 0
    heights = shirt.points()[:, 2]
    assert heights.min() > -RADIUS
    covered = [metrics.covered_area(v, shirt.triangles) for v in (shirt.laid(), shirt.points())]
    assert covered[1] < 0.7 * covered[0]
    assert np.sqrt(np.mean(np.sum(shirt.velocities() ** 2, axis=1))) < 0.05  # Nearly at rest.
    assert np.percentile(np.abs(shirt.edge_strain()), 99) < 0.1
    assert scene.physics.data.ptr.warning.number.sum() == 0


def test_parts_that_are_not_connected_are_one_garment(tmp_path):
    file = tmp_path / "pair.obj"
    apart = "v .1 0 0\nv .13 0 0\nv .13 .03 0\n"
    file.write_text(SQUARE + apart + "f 1 2 3 4\nf 5 6 7\n")
    with pytest.warns(match="2 parts are not connected, of 4, 3 vertices"):
        pair = Garment(file)
    scene = Scene(pair, pair.laid() + np.array([[0, 0, 0.1]] * 4 + [[0, 0, 0.3]] * 3))
    scene.step(100)
    np.testing.assert_allclose(pair.points()[:, 2], RADIUS, atol=1e-3)
    np.testing.assert_allclose(pair.edge_strain(), 0.0, atol=0.01)


def test_the_shipped_t_shirt_is_what_its_tool_draws():
    drawn = subprocess.run([sys.executable, TOOL], capture_output=True, text=True, check=True)
    assert drawn.stdout == pathlib.Path(T_SHIRT).read_text()
