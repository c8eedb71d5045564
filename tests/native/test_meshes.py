"""Meshes of ropes and water, beside volumes and shapes that are known."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.meshes import (
    LEAST_TRIANGLES,
    PLAIN,
    ROPE,
    Strands,
    tube,
    tube_faces,
    water_mesh,
)

SPACING = 0.015
RADIUS = 0.0625


class Surface:
    """Measures of a triangle mesh; equal vertices count as one."""

    def __init__(self, vertices, normals, faces):
        self.vertices, self.normals = vertices.astype(float), normals.astype(float)
        self.corners = self.vertices[faces]
        self.crosses = np.cross(
            self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        )
        # Divergence theorem; about a point of it, for precision.
        self.volume = np.linalg.det(self.corners - self.corners.mean(axis=(0, 1))).sum() / 6
        self.area = np.linalg.norm(self.crosses, axis=1).sum() / 2
        _, weld = np.unique(vertices, axis=0, return_inverse=True)
        self.faces, self.normals_of_corners = weld.reshape(-1)[faces], self.normals[faces]
        self.sides = np.concatenate([self.faces[:, k] for k in ([0, 1], [1, 2], [2, 0])])

    def check(self, least_agreement=0.8):
        """It is closed, each side of a triangle is one of another, too, and normals are right."""
        sides, counts = np.unique(self.sides, axis=0, return_counts=True)
        assert (counts == 1).all()
        np.testing.assert_array_equal(np.unique(sides[:, ::-1], axis=0), sides)
        assert self.volume > 0
        np.testing.assert_allclose(np.linalg.norm(self.normals, axis=1), 1, atol=1e-5)
        # Weighted with the area.
        agreement = np.einsum("fk,fck->f", self.crosses, self.normals_of_corners).sum() / 3
        assert agreement > least_agreement * 2 * self.area

    @property
    def euler_number(self):
        return len(np.unique(self.faces)) - len(self.sides) // 2 + len(self.faces)

    @property
    def pieces(self):
        count = self.faces.max() + 1
        graph = coo_matrix((np.ones(len(self.sides)), self.sides.T), shape=(count, count))
        return connected_components(graph)[0]


# ---------------------------------------------------------------------------- ropes


def tube_of(points, radius=RADIUS, sides=24, rings_per_edge=8, strands=PLAIN):
    vertices, normals = tube(
        points, radius, sides=sides, rings_per_edge=rings_per_edge, strands=strands
    )
    faces, texture = tube_faces(len(points), sides=sides, rings_per_edge=rings_per_edge)
    assert vertices.dtype == normals.dtype == texture.dtype == np.float32
    assert len(texture) == len(vertices)
    return Surface(vertices, normals, faces)


def line(length=2.0, n=9):
    return np.linspace(0, length, n)[:, None] * [0.6, 0.0, 0.8]


def helix():
    t = np.linspace(0, 4 * np.pi, 41)
    return np.stack([np.cos(t), np.sin(t), 0.1 * t], axis=1)


def fold(n=21):
    """A rope that turns back on itself more sharply than it is thick."""
    t = np.linspace(-1, 1, n)
    return np.stack([np.abs(t), 0.01 * t, 0 * t], axis=1)


def bend():
    """One way, then the other: frames that follow the curvature would flip in between."""
    t = np.linspace(-3, 3, 31)
    return np.stack([t, np.sin(t), 0 * t], axis=1)


ENDED = np.concatenate([line()[:1].repeat(3, axis=0), line(), line()[-1:].repeat(3, axis=0)])


@pytest.mark.parametrize("strands", [PLAIN, Strands(3, 0.22, 7.0)])
@pytest.mark.parametrize("points", [line(), helix(), bend(), ENDED])
@pytest.mark.parametrize(("sides", "rings_per_edge"), [(8, 3), (24, 8)])
def test_a_tube_is_closed(points, strands, sides, rings_per_edge):
    surface = tube_of(points, RADIUS, sides, rings_per_edge, strands)
    if points is not ENDED:  # Rings that lie on each other have no sides of their own.
        surface.check()
        assert surface.euler_number == 2
    assert surface.volume > 0
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("points", [line(n=2), line(), ENDED])
def test_a_straight_tube_is_a_capsule(points):
    surface = tube_of(points, sides=64)
    assert surface.volume == pytest.approx(np.pi * RADIUS**2 * (2 + 4 / 3 * RADIUS), rel=0.01)
    axis = np.array([0.6, 0, 0.8])
    nearest = np.clip(surface.vertices @ axis, 0, 2)[:, None] * axis
    away = (surface.vertices - nearest) / RADIUS
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1, atol=1e-4)
    np.testing.assert_allclose(surface.normals, away, atol=0.1)


def test_a_tube_around_a_circle_is_a_torus():
    angle = np.linspace(0, 2 * np.pi, 33)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    surface = tube_of(ring, sides=48)
    caps_volume, caps_area = 4 / 3 * np.pi * RADIUS**3, 4 * np.pi * RADIUS**2
    torus = 2 * np.pi**2 * RADIUS**2
    assert surface.volume - caps_volume == pytest.approx(torus, rel=0.01)
    assert surface.area - caps_area == pytest.approx(4 * np.pi**2 * RADIUS, rel=0.01)


def test_strands_are_as_deep_as_asked_for_and_wind():
    sides, rings = 48, 8
    length, strands = 2.0, Strands(3, 0.22, np.pi)  # A whole turn.
    surface = tube_of(line(length), RADIUS, sides, rings, strands)
    caps = sides // 4
    grid = surface.vertices.reshape(-1, sides + 1, 3)[caps:-caps, :-1]
    axis = np.array([0.6, 0, 0.8])
    radii = np.linalg.norm(grid - (grid @ axis)[..., None] * axis, axis=2) / RADIUS
    np.testing.assert_allclose(radii.max(axis=1), 1, atol=2e-3)
    np.testing.assert_allclose(radii.min(axis=1), 1 - 0.22, atol=0.02)
    spectrum = np.abs(np.fft.rfft(radii, axis=1))[:, 1:]
    assert (spectrum.argmax(axis=1) == 3 - 1).all()
    phase = np.unwrap(np.angle(np.fft.rfft(radii, axis=1)[:, 3]))
    assert abs(phase[-1] - phase[0]) == pytest.approx(3 * 2 * np.pi, abs=1e-3)


def test_frames_neither_flip_nor_twist():
    sides, rings = 16, 4
    for points in (bend(), helix(), fold()):
        grid = tube_of(points, 1e-3, sides, rings).vertices.reshape(-1, sides + 1, 3)
        body = grid[sides // 4 : -(sides // 4), :-1]
        centers = body.mean(axis=1)
        spokes = (body[:, 0] - centers) / 1e-3
        tangents = np.gradient(centers, axis=0)
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        # The part of a spoke's turn that is about the tangent.
        turns = np.einsum(
            "nk,nk->n", np.cross(spokes[:-1], spokes[1:]), tangents[:-1] + tangents[1:]
        )
        assert np.abs(turns).max() < 0.05


def test_any_points_make_a_tube():
    for points in (np.zeros((5, 3)), fold(), np.zeros((2, 3)), 1e20 * helix()):
        vertices, normals = tube(points, 0.01, sides=8, rings_per_edge=3, strands=ROPE)
        assert np.isfinite(vertices).all()
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)
    one, other = (tube(helix(), 0.01, sides=8, rings_per_edge=3) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("argument", "change"),
    [
        ("points", {"points": np.zeros((1, 3))}),
        ("points", {"points": np.zeros((4, 2))}),
        ("points", {"points": np.full((4, 3), np.nan)}),
        ("points", {"points": "rope"}),
        ("radius", {"radius": 0.0}),
        ("radius", {"radius": np.nan}),
        ("sides", {"sides": 2}),
        ("rings_per_edge", {"rings_per_edge": 0}),
        ("strands.lobes", {"strands": Strands(-1, 0.2, 70.0)}),
        ("strands.depth", {"strands": Strands(3, 1.1, 70.0)}),
        ("strands.twist", {"strands": Strands(3, 0.2, np.inf)}),
    ],
)
def test_a_tube_refuses_bad_arguments(argument, change):
    good = {"points": helix(), "radius": 0.01, "sides": 8, "rings_per_edge": 3}
    with pytest.raises(InvalidArgumentError, match=f"^{argument}="):
        tube(**good | change)


# ---------------------------------------------------------------------------- water


def lattice(*counts):
    axes = [np.arange(n) - (n - 1) / 2 for n in counts]
    return SPACING * np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def shaken(points):
    return points + np.random.default_rng(0).uniform(-0.1, 0.1, points.shape) * SPACING


def water_of(points, voxel=0.5, **options):
    mesh = water_mesh(points, SPACING, voxel * SPACING, **options)
    assert mesh.vertices.dtype == mesh.normals.dtype == np.float32
    return Surface(*mesh)


@pytest.mark.parametrize("voxel", [1.0, 0.5, 0.3])
def test_a_ball_of_particles_is_a_ball(voxel):
    points = lattice(19, 19, 19)
    points = shaken(points[np.linalg.norm(points, axis=1) < 7.5 * SPACING])
    surface = water_of(points, voxel)
    surface.check()
    assert surface.euler_number == 2
    assert surface.volume == pytest.approx(len(points) * SPACING**3, rel=0.06)
    radii = np.linalg.norm(surface.vertices, axis=1)
    radius = np.cbrt(0.75 / np.pi * len(points)) * SPACING
    np.testing.assert_allclose(radii, radius, atol=0.6 * SPACING)
    assert radii.std() < 0.2 * SPACING
    cosines = np.einsum("nk,nk->n", surface.normals, surface.vertices) / radii
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean() < 15


@pytest.mark.parametrize("voxel", [1.0, 0.5])
def test_still_water_is_flat(voxel):
    points = shaken(lattice(20, 20, 8))
    surface = water_of(points, voxel)
    surface.check()
    assert surface.volume == pytest.approx(len(points) * SPACING**3, rel=0.06)
    x, y, z = surface.vertices.T / SPACING
    top = (np.abs(x) < 7) & (np.abs(y) < 7) & (z > 2)
    # The outermost particles, whose centers are at 3.5, reach half a spacing further.
    np.testing.assert_allclose(z[top], 4.0, atol=0.35)
    assert z[top].std() < 0.05
    assert surface.normals[top, 2].min() > 0.95


@pytest.mark.parametrize("voxel", [1.0, 0.5, 0.3])
@pytest.mark.parametrize("distance", [1.0, 1.5, 1.9])
def test_a_falling_stream_is_in_one_piece(voxel, distance):
    points = np.arange(20)[:, None] * distance * SPACING * np.array([0.1, 0.2, 0.97])
    points += np.random.default_rng(0).uniform(-0.1, 0.1, points.shape) * SPACING
    assert water_of(points, voxel).pieces == 1
    assert water_of(3 * points, voxel).pieces == 20  # Drops.


@pytest.mark.parametrize("voxel", [2.0, 1.0, 0.5, 0.2])
def test_a_lone_drop_is_there(voxel):
    for position in np.random.default_rng(0).uniform(0.5, 0.6, (50, 3)):
        surface = water_of(position[None], voxel)
        surface.check(0.5)  # Coarse ones are octahedra.
        assert surface.euler_number == 2
        np.testing.assert_allclose(
            surface.vertices.mean(axis=0), position, atol=0.5 * max(voxel, 1) * SPACING
        )
    if voxel < 0.5:
        assert surface.volume == pytest.approx(SPACING**3, rel=0.25)


def test_splashes_are_closed():
    rng = np.random.default_rng(0)
    for scale in (2, 4, 8, 16):
        water_of(rng.normal(size=(300, 3)) * scale * SPACING).check()


def test_the_surface_can_be_offset():
    points = shaken(lattice(10, 10, 10))
    plain, drawn_in = water_of(points), water_of(points, offset=-0.2 * SPACING)
    np.testing.assert_allclose(
        drawn_in.vertices, plain.vertices - 0.2 * SPACING * plain.normals, atol=1e-6
    )


def test_particles_that_are_nowhere_are_left_out():
    points = shaken(lattice(5, 5, 5))
    lost = [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [1e30, 0, 0], [0, 2e6 * SPACING, 0]]
    plain, with_lost = (water_mesh(p, SPACING, SPACING) for p in (points, [*points, *lost]))
    for one, other in zip(plain, with_lost, strict=True):
        np.testing.assert_array_equal(one, other)
    far = points + 1e4 * SPACING * np.array([1, -1, 1])
    assert Surface(*water_mesh(far, SPACING, SPACING)).pieces == 1
    assert len(water_mesh(np.full((3, 3), np.nan), SPACING, SPACING).faces) == 0
    assert len(water_mesh(np.zeros((0, 3)), SPACING, SPACING).vertices) == 0


def test_particles_in_one_place_cost_no_more_than_others():
    water_of(np.zeros((50_000, 3))).check()
    water_of(np.random.default_rng(0).normal(size=(50_000, 3)) * 1e-3 * SPACING).check()


def test_a_surface_keeps_to_the_number_of_triangles():
    points = shaken(lattice(12, 12, 12))
    free = water_mesh(points, SPACING, 0.5 * SPACING)
    most = len(free.faces) // 3
    coarse = water_mesh(points, SPACING, 0.5 * SPACING, most_triangles=most)
    assert most / 3 < len(coarse.faces) <= most
    Surface(*coarse).check()
    with pytest.raises(InvalidArgumentError, match=r"^most_triangles="):
        water_mesh(points, SPACING, SPACING, most_triangles=7)


@pytest.mark.parametrize("distance", [3.0, 30.0, 3e3, 9e5])
def test_some_hundred_triangles_are_enough_for_any_drops(distance):
    points = distance * SPACING * np.random.default_rng(0).uniform(-1, 1, (400, 3))
    mesh = water_mesh(points, SPACING, 1.25 * SPACING, most_triangles=LEAST_TRIANGLES)
    assert 0 < len(mesh.faces) <= LEAST_TRIANGLES
    Surface(*mesh).check(0.6)  # Drops have few corners.


@pytest.mark.parametrize(
    ("argument", "change"),
    [
        ("positions", {"positions": np.zeros(3)}),
        ("positions", {"positions": [["a", "b", "c"]]}),
        ("spacing", {"spacing": 0.0}),
        ("spacing", {"spacing": np.nan}),
        ("voxel", {"voxel": SPACING / 100}),
        ("voxel", {"voxel": -SPACING}),
        ("offset", {"offset": 2 * SPACING}),
        ("most_triangles", {"most_triangles": 0}),
        ("most_triangles", {"most_triangles": 1 << 40}),
    ],
)
def test_water_refuses_bad_arguments(argument, change):
    good = {"positions": np.zeros((1, 3)), "spacing": SPACING, "voxel": SPACING}
    with pytest.raises(InvalidArgumentError, match=f"^{argument}="):
        water_mesh(**good | change)


# ---------------------------------------------------------------------------- memory


def test_a_lack_of_memory_is_an_error():
    """In a process of its own, which may have little more than it has."""
    code = """
import resource
import numpy as np
from softgym_mj.native.meshes import water_mesh
water_mesh(np.zeros((1, 3)), 1.0, 1.0)
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
points = np.random.default_rng(0).uniform(-100, 100, (20000, 3))
resource.setrlimit(resource.RLIMIT_AS, (used + (64 << 20),) * 2)
try:
    water_mesh(points, 1.0, 0.5, most_triangles=100)
except MemoryError:
    print("refused")
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.stdout == "refused\n", done.stderr
