"""The cloth looks and moves like cloth: sizes, order, strain, floor, rest, release."""

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.cloth import Cloth, grid_shape
from softgym_mj.entities.fabric import AREA_DENSITY, THICKNESS
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.robots.workspace import Workspace
from tests.scenes.manipulation import ManipulationScene, fold, lift_and_release

RADIUS = THICKNESS / 2.0  # [m]


@pytest.mark.parametrize(
    ("dims", "fidelity", "shape"),
    [
        # (dim - 1) * 0.00625 m in an even number of steps of about 0.03 / 0.04 / 0.02 m, plus one.
        ((60, 60), "default", (13, 13)),
        ((119, 60), "default", (13, 25)),
        ((96, 58), "default", (13, 21)),
        ((96, 58), "fast", (9, 15)),
        ((96, 58), "accurate", (19, 31)),
    ],
)
def test_grid_has_the_expected_rows_and_columns(dims, fidelity, shape):
    assert grid_shape(dims, fidelity) == shape


def test_order_size_and_mass_follow_softgym():
    scene = ManipulationScene(Cloth(dims=(96, 58)))
    cloth = scene.cloth
    grid = cloth.grid()
    assert cloth.size == pytest.approx((0.59375, 0.35625))
    # Column 0 at the smallest X; row 0 at the largest Y (FleX: the smallest z).
    np.testing.assert_allclose(grid[0, 0], [-0.296875, 0.178125, RADIUS], atol=1e-12)
    np.testing.assert_allclose(grid[-1, -1], [0.296875, -0.178125, RADIUS], atol=1e-12)
    p1, p2, p3, p4 = cloth.points()[cloth.corners]
    np.testing.assert_array_equal([p1, p2], [grid[0, 0], grid[-1, 0]])
    np.testing.assert_array_equal([p3, p4], [grid[0, -1], grid[-1, -1]])
    assert cloth.index(-1, 2) == (cloth.shape[0] - 1) * cloth.shape[1] + 2
    with pytest.raises(InvalidArgumentError, match="grid of"):
        cloth.index(cloth.shape[0], 0)
    model = scene.physics.model.ptr
    assert model.body_subtreemass[0] - model.body_mass[:1].sum() > 0
    total = sum(model.body_mass[model.body(f"cloth/flex_{i}").id] for i in range(cloth.num_points))
    assert total == pytest.approx(AREA_DENSITY * 0.59375 * 0.35625)
    # Triangles are counter-clockwise from above and tile the rectangle.
    a, b, c = (cloth.points()[cloth.triangles[:, i], :2] for i in range(3))
    u, v = b - a, c - a
    areas = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert (areas > 0).all() and areas.sum() == pytest.approx(0.59375 * 0.35625)


def test_a_flat_cloth_rests_at_its_radius():
    scene = ManipulationScene(Cloth(dims=(60, 60)))
    mujoco.mj_step(scene.physics.model.ptr, scene.physics.data.ptr, 50)
    np.testing.assert_allclose(scene.cloth.points()[:, 2], RADIUS, atol=5e-4)
    assert np.abs(scene.cloth.velocities()).max() < 1e-4


def assert_clean(record):
    """Checks a scripted motion: held, unstretched, above the floor, at rest in the end."""
    assert record.held_error < 1e-3
    assert record.strain_99 <= 0.12  # When it hits the floor; 0.07 in a fold.
    assert record.lowest > -RADIUS
    assert record.settle_time(speed=0.02) < 2.0
    assert record.warnings == 0
    assert record.end_intersections == 0


def test_a_dropped_cloth_is_clean():
    scene = ManipulationScene(Cloth(dims=(72, 66)))
    lift_and_release(scene, speed=0.6)
    assert_clean(scene.record)


def test_a_fold_is_clean_and_brings_the_halves_together():
    scene = ManipulationScene(Cloth(dims=(72, 66)))
    fold(scene, speed=0.6)
    assert_clean(scene.record)
    grid = scene.cloth.grid()
    columns = grid.shape[1]
    half = columns // 2
    pairs = np.linalg.norm(grid[:, :half] - grid[:, ::-1][:, :half], axis=-1)
    # Two layers lie a thickness (1 cm) apart; unfolded, the mean would be 0.22 m.
    assert 0.008 < np.median(pairs) < 0.025
    assert grid[:, columns - 1, 0] == pytest.approx(0.222, abs=0.02)  # The lower half stayed.


def test_a_release_leaves_the_vertex_its_velocity():
    scene = ManipulationScene(Cloth(dims=(60, 60)))
    corner = int(scene.cloth.corners[0])
    scene.grip([corner, int(scene.cloth.corners[1])])
    for _ in range(20):
        scene.step(np.tile([0.0, 0.0, 0.008], (2, 1)), grip=True)
    before = scene.cloth.velocities()[corner]
    np.testing.assert_allclose(before, [0.0, 0.0, 0.8], atol=0.02)
    scene.step(np.zeros((2, 3)), grip=False)
    after = scene.cloth.velocities()[corner]
    # The 0.2 g vertex is now pulled down by the hanging cloth and gravity, it does not explode.
    assert np.linalg.norm(after) < 1.5
    model = scene.physics.model.ptr
    assert np.ptp(model.dof_M0[3 * corner : 3 * corner + 3]) == 0.0
    assert model.dof_M0[3 * corner] < 1e-3


def test_layers_lie_a_thickness_apart():
    scene = ManipulationScene(Cloth(dims=(60, 60), fidelity="fast"))
    fold(scene, speed=0.6, rest=1.0)
    grid = scene.cloth.grid()
    # The folded half, less the crease and its neighbors, on the half below.
    upper = grid[:, : grid.shape[1] // 2 - 1, 2]
    assert np.median(upper) == pytest.approx(3 * RADIUS, abs=2e-4)


@pytest.mark.parametrize("fidelity", ["fast", pytest.param("accurate", marks=pytest.mark.slow)])
def test_a_marker_shows_the_other_side_on_an_eighth(fidelity):
    """SoftGym's strip: 5 quads from quad floor((dimx - 1) / 8) on, in its spacing."""
    env = softgym_mj.load("fold_cloth", split="evaluate", fidelity=fidelity)
    env.reset(800)
    cloth = env.task.cloth
    cloth.set_points(cloth.flat())
    env.task.actor.place(
        np.array([[0.8, 0.3, 0.4], [0.8, -0.3, 0.4]]), Workspace((-1,) * 3, (1,) * 3)
    )
    view = CameraView("task", 480, 480)
    image = view.rgb(env.physics).astype(int)
    # Along the middle row, on the upper side.
    grid = cloth.grid()[cloth.shape[0] // 2]
    share = np.linspace(0.03, 0.97, 400)
    line = np.array([np.interp(share, np.linspace(0, 1, len(grid)), x) for x in grid.T]).T
    pixels, _ = view.calibration(env.physics).project(line)
    red, green, blue = image[tuple(np.round(pixels[:, ::-1]).astype(int).T)].T
    raspberry = (red > 2 * green) & (red > 80)
    cream = (red > 120) & (green > 0.7 * red) & (blue < 0.75 * red)
    assert np.mean(raspberry | cream) > 0.95
    found = share[raspberry] * cloth.size[0]
    first = (cloth.dims[0] - 1) // 8 * 0.00625
    assert found.min() == pytest.approx(first, abs=0.006)
    assert found.max() == pytest.approx(first + 0.03125, abs=0.006)
    assert len(found) == pytest.approx(0.03125 / cloth.size[0] * len(share) / 0.94, rel=0.2)


@pytest.mark.parametrize(
    ("size", "dims"),
    [
        ((0.6, 0.6), (97, 97)),  # 96 spacings of 6.25 mm.
        ((0.35, 0.3), (57, 49)),
        ((0.602, 0.604), (97, 98)),  # 96.32 and 96.64 spacings.
        ((0.05625, 1.24375), (10, 200)),  # The smallest and the largest side.
    ],
)
def test_sizes_in_meters_are_whole_numbers_of_particle_spacings(size, dims):
    cloth, same = Cloth(size), Cloth(dims=dims)
    assert cloth.dims == same.dims == dims and cloth.shape == same.shape
    width, depth, _ = np.ptp(cloth.flat(), axis=0)
    np.testing.assert_allclose((width, depth), size, atol=0.00625 / 2)
    np.testing.assert_allclose((width, depth), cloth.size, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"size": (60, 60)}, r"size=\(60, 60\).*two lengths in 0\.056\.\.1\.244 m"),
        ({"size": (0.6,)}, "size"),
        ({"size": (0.6, np.nan)}, "size"),
        ({"size": (0.6, 0.6), "dims": (97, 97)}, r"dims=\(97, 97\).*None, because `size` is given"),
        ({"dims": (9, 97)}, r"dims=\(9, 97\).*10\.\.200 particles"),
    ],
)
def test_bad_sizes_are_named(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Cloth(**arguments)
