"""Meshes of other people become garments that fall without crossing, or are refused by name."""

import re
import warnings

import numpy as np
import pytest
import trimesh

from softgym_mj import assets
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.garment import Garment
from softgym_mj.entities.mesh_files import MOST_VERTICES, read_mesh
from softgym_mj.exceptions import InvalidArgumentError
from tests.cloth.test_slivers import irregular, with_sliver_inside
from tests.entities.test_garment import T_SHIRT, Scene, obj

SQUARE = "v 0 0 0\nv .03 0 0\nv .03 .03 0\nv 0 .03 0\n"
SHIRT = trimesh.load_mesh(assets.path("garments/t_shirt.obj"), process=False, maintain_order=True)
POINTS, TRIANGLES = np.asarray(SHIRT.vertices), np.asarray(SHIRT.faces)


def _quads():
    """A sheet of 8 x 8 vertices as text: quads and a hexagon."""
    x, y = np.meshgrid(np.arange(8) * 0.03, np.arange(8) * 0.03)
    lines = [f"v {a:.4f} {b:.4f} 0" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    for i in range(7):
        for j in range(7):
            a = 8 * i + j + 1
            if i == 3 and j == 3:
                lines.append(f"f {a} {a + 1} {a + 2} {a + 10} {a + 9} {a + 8}")
            elif not (i == 3 and j == 4):
                lines.append(f"f {a} {a + 1} {a + 9} {a + 8}")
    return "\n".join(lines)


def _mesh(name):
    """Points and triangles of a garment as others make them, and the warning that it gets."""
    points, triangles, warning = POINTS, TRIANGLES, None
    match name:
        case "holes":
            middle = points[triangles].mean(axis=1)
            triangles = triangles[np.linalg.norm(middle[:, :2], axis=1) > 0.06]
        case "duplicated vertices":  # Each triangle has its own, as in STL.
            points, triangles = points[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3)
        case "nearly equal vertices":
            noise = np.random.default_rng(0).uniform(-2e-5, 2e-5, (triangles.size, 3))
            points = points[triangles.ravel()] + noise
            triangles = np.arange(triangles.size).reshape(-1, 3)
        case "collapsed faces":
            extra = [[0, 0, 1], [5, 6, 5], triangles[9], triangles[9][::-1]]
            triangles = np.vstack([triangles, extra])
            warning = "dropped 4 of .* triangles"
        case "slim triangles" | "an edge ratio above 4" | "a sliver":
            flex = {
                "slim triangles": irregular(0),
                "an edge ratio above 4": irregular(4, count=60),
                "a sliver": with_sliver_inside(4e-4),
            }[name]
            points, triangles = flex.points, flex.elements
            warning = "triangles are lower than 0.0056"
        case "two parts":
            warning = "2 parts are not connected, of {0}, {0} vertices: all".format(len(points))
            triangles = np.vstack([triangles, triangles + len(points)])
            points = np.vstack([points, points + [0.0, 0.0, 0.1]])
        case "a pocket":  # Three triangles at an edge.
            a, b = triangles[200][:2]
            apex = (points[a] + points[b]) / 2.0 + [0.0, 0.0, 0.025]
            triangles = np.vstack([triangles, [a, b, len(points)]])
            points, warning = np.vstack([points, apex]), "1 edges belong to more than 2"
    return points, triangles, warning


@pytest.mark.parametrize(
    "name",
    [
        *("holes", "duplicated vertices", "slim triangles", "two parts", "a pocket"),
        *(
            pytest.param(name, marks=pytest.mark.long)
            for name in ("nearly equal vertices", "collapsed faces", "a sliver",
                         "an edge ratio above 4")
        ),
    ],
)  # fmt: skip
def test_meshes_of_all_kinds_fall_without_crossing(tmp_path, name):
    points, triangles, warning = _mesh(name)
    file = obj(tmp_path / "mesh.obj", points, triangles)
    fabric = Fabric(thickness=0.005) if "lower" in (warning or "") else None
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        garment = Garment(file, fabric=fabric)
    assert len(found) == (warning is not None)
    assert re.search(warning or "", "".join(str(each.message) for each in found))
    start = garment.laid()
    # One side is higher: it lands folded over.
    start[:, 2] += 0.05 + 0.6 * (start[:, 0] - start[:, 0].min())
    scene = Scene(garment, start)
    assert garment.intersections() == 0
    scene.step(120)
    assert scene.crossings == 0
    assert scene.physics.data.ptr.warning.number.sum() == 0
    assert np.percentile(np.abs(garment.edge_strain()), 99) < 0.15
    assert garment.points()[:, 2].min() > -0.005


def test_repaired_meshes_have_the_vertices_of_whole_ones(tmp_path):
    whole = read_mesh(T_SHIRT)
    np.testing.assert_allclose(whole[0], POINTS, atol=1e-7)
    np.testing.assert_array_equal(whole[1], TRIANGLES)
    for name, most in (("duplicated vertices", 1e-7), ("nearly equal vertices", 3e-5)):
        points, triangles, _ = _mesh(name)
        found = read_mesh(obj(tmp_path / "mesh.obj", points, triangles))
        assert found[0].shape == whole[0].shape
        np.testing.assert_allclose(found[0][found[1]], POINTS[TRIANGLES], atol=most)


def test_polygons_become_triangles_of_the_same_area(tmp_path):
    file = tmp_path / "quads.obj"
    file.write_text(_quads())
    # A corner of the hexagon is on the line between two others.
    with pytest.warns(match="1 triangles are lower than 0.0001 m and"):
        garment = Garment(file)
    assert len(garment.triangles) == 2 * 49
    assert garment.area == pytest.approx((7 * 0.03) ** 2, rel=1e-6)


def test_what_no_triangle_has_is_left_out(tmp_path):
    file = tmp_path / "mesh.obj"
    # A polygon, a vertex that no triangle has, one that is there twice.
    file.write_text(SQUARE + "v 9 9 9\nv .03 0 0\nv .06 0 0\nf 1 2 3 4\nf 6 7 3\n")
    points, triangles = read_mesh(file, scale=2.0)
    assert points.shape == (5, 3) and len(triangles) == 3
    assert points.max() == pytest.approx(0.12, rel=1e-6)


@pytest.mark.parametrize(("unit", "scale"), [("millimeters", 0.001), ("centimeters", 0.01)])
def test_other_units_are_refused_with_the_scale(tmp_path, unit, scale):
    file = obj(tmp_path / "shirt.obj", POINTS / scale, TRIANGLES)
    with pytest.raises(InvalidArgumentError, match=f"looks like {unit}: pass scale={scale:g}"):
        Garment(file)
    np.testing.assert_allclose(Garment(file, scale=scale).laid(), Garment(T_SHIRT).laid())


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply", ".stl"])
def test_all_kinds_of_files_hold_the_same_garment(tmp_path, suffix):
    file = tmp_path / f"shirt{suffix}"
    SHIRT.export(file)
    points, triangles = read_mesh(file)
    np.testing.assert_allclose(points[triangles], POINTS[TRIANGLES], atol=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello", "a mesh with triangles"),
        (SQUARE, "a mesh with triangles"),
        (SQUARE + "f 1 2 9\n", "trimesh cannot read"),
        (SQUARE + "f a b c\n", "trimesh cannot read"),
        (SQUARE.replace(".03", "nan") + "f 1 2 3\n", "finite numbers"),
        (SQUARE + "f 1 1 2\n", "triangle of area above 0"),
        (SQUARE.replace(".03", ".003") + "f 1 2 3\n", "measures 0.003 m .* expected 0.02 to 5.0 m"),
        (SQUARE.replace(".03", "9") + "f 1 2 3\n", "measures 9 m .* Pass its unit in meters"),
    ],
)
def test_bad_meshes_are_errors(tmp_path, text, message):
    file = tmp_path / "mesh.obj"
    file.write_text(text)
    with pytest.raises(InvalidArgumentError, match=message):
        Garment(file)


def test_bad_arguments_are_errors(tmp_path):
    (tmp_path / "picture.png").write_bytes(b"\x89PNG")
    side = np.linspace(0.0, 1.0, 80)
    x, y = np.meshgrid(side, side)
    corner = np.arange(80 * 79)[np.arange(80 * 79) % 80 != 79]
    halves = np.column_stack([corner, corner + 1, corner + 80])
    large = obj(
        tmp_path / "large.obj", np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), halves
    )
    for bad, message in (
        (lambda: Garment(tmp_path / "none.obj"), "a file that exists: .obj, .off"),
        (lambda: Garment(tmp_path / "picture.png"), "a file that exists: .obj, .off"),
        (lambda: Garment(T_SHIRT, scale=0.0), "scale=0"),
        (lambda: Garment(large), f"6399 vertices; expected at most {MOST_VERTICES}: simplify"),
        (lambda: Fabric(thickness=float("nan")), "thickness=nan"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            bad()
