"""The tasks that fold and drop a cloth: hand-computed values, perfect ends, starts."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.fabric import THICKNESS
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.starts.cloths import FlatCloth, HangingCloth
from softgym_mj.variations.indices import NUM_VARIATIONS
from tests.scenes.alone import compiled

RADIUS = THICKNESS / 2.0  # [m]

FOLD_TASKS = ("fold_cloth", "fold_crumpled_cloth", "drop_fold_cloth")
DROP_TASKS = ("drop_cloth", "drop_fold_cloth")
LAYER = 0.01


def make(task, **kwargs):
    return softgym_mj.load(task, **{"split": "evaluate", "fidelity": "fast", **kwargs})


def compiled_cloth(dims, fidelity="default"):
    cloth = Cloth(dims=dims, fidelity=fidelity)
    compiled(cloth)
    return cloth


def folded(cloth, flat, layer=LAYER):
    """The flat cloth with the first half of its columns laid over the second, exactly."""
    grid = flat.reshape(*cloth.shape, 3).copy()
    columns = cloth.shape[1]
    for i in range(columns // 2):
        grid[:, i] = grid[:, columns - 1 - i] + [0.0, 0.0, layer]
    return grid.reshape(-1, 3)


@pytest.fixture(name="fold", scope="module")
def _fold():
    return make("fold_cloth")


@pytest.fixture(name="drop", scope="module")
def _drop():
    return make("drop_cloth")


def measured(env):
    env.task.after_step(env.physics, None)
    return env.info()


# ------------------------------------------------------------------------------------- particles


@pytest.mark.parametrize("fidelity", ["fast", "default", "accurate"])
def test_particles_are_softgyms(fidelity):
    cloth = compiled_cloth((61, 80), fidelity)
    particles = cloth.particles(cloth.flat())
    assert particles.shape == (80, 61, 3)
    x = 0.00625 * (np.arange(61) - 30)
    y = 0.00625 * (39.5 - np.arange(80))
    np.testing.assert_allclose(particles[..., 0], np.tile(x, (80, 1)), atol=1e-12)
    np.testing.assert_allclose(particles[..., 1], np.tile(y[:, None], (1, 61)), atol=1e-12)


def slow_fold(sheet, reference):
    """docs/softgym.md 3.7, word by word: mean distance of the pairs, mean displacement."""
    rows, columns = sheet.shape[:2]
    pair, moved = [], []
    for j in range(rows):
        for i in range(columns // 2):
            a, b = sheet[j, i], sheet[j, columns - 1 - i]
            pair.append(np.sqrt(sum((a - b) ** 2)))
            moved.append(np.sqrt(sum((b - reference[j, columns - 1 - i]) ** 2)))
    return sum(pair) / len(pair), sum(moved) / len(moved)


@pytest.mark.parametrize("columns", [6, 7])
def test_folds_are_measured_as_by_a_slow_loop(columns):
    random = np.random.default_rng(columns)
    cloth = compiled_cloth((60 + columns, 65), "fast")
    points, goal = random.normal(size=(2, cloth.num_points, 3))
    sheet, reference = cloth.particles(points), cloth.particles(goal)
    measures = metrics.fold(cloth.arrays, points, reference)
    pair, moved = slow_fold(sheet, reference)
    assert list(measures.info.values()) == pytest.approx([pair, moved], rel=1e-12)
    assert measures.performance == measures.reward == pytest.approx(-pair - 1.2 * moved, rel=1e-12)


# ----------------------------------------------------------------------------------------- folding


@pytest.mark.parametrize(
    ("dimx", "fidelity", "expected"),
    [
        (60, "fast", -0.1875),
        (61, "default", -0.19375),
        (90, "default", -0.28125),
        (119, "fast", -0.375),
    ],
)
def test_a_flat_cloth_has_softgyms_initial_performance(dimx, fidelity, expected):
    """The bound of docs/softgym.md 3.7, by hand."""
    cloth = compiled_cloth((dimx, 70), fidelity)
    cloth.set_points(cloth.flat(angle=0.3))
    measures = metrics.fold(cloth.arrays, cloth.points(), cloth.particles())
    assert measures.performance == pytest.approx(expected, abs=1e-9)
    assert measures.rewards == {
        "pair_distance": pytest.approx(expected, abs=1e-9),
        "displacement": pytest.approx(0.0, abs=1e-9),
    }


@pytest.mark.parametrize("task", FOLD_TASKS)
def test_a_perfect_fold_scores_one_less_its_layer(task):
    env = make(task)
    env.reset(805)
    cloth = env.task.cloth
    places = {
        "fold_cloth": cloth.points(),
        "fold_crumpled_cloth": cloth.flat(),
        "drop_fold_cloth": cloth.flat(center=(cloth.size[0] / 2, 0.0)),
    }
    # Without thickness it would be 1; in an even number of columns no vertex lies on the fold.
    for layer in (0.0, LAYER):
        cloth.set_points(folded(cloth, places[task], layer))
        info = measured(env)
        exact = 1.0 - layer / -env.task.episode.initial_performance
        assert info["normalized_performance"] == pytest.approx(exact, abs=0.02)
        assert info["success"]
    assert info["displacement"] == pytest.approx(0.0, abs=2e-3)


@pytest.mark.parametrize("fidelity", ["fast", "default"])
def test_the_performance_of_a_shape_does_not_depend_on_the_resolution(fidelity):
    """A cloth bent to a half pipe, whatever the number of its vertices."""
    cloth = compiled_cloth((91, 61), fidelity)
    x, y, _ = cloth.flat().T
    radius = cloth.size[0] / np.pi
    angle = x / radius
    bent = np.column_stack([radius * np.sin(angle), y, radius * (1.0 - np.cos(angle))])
    cloth.set_points(bent)
    goal = cloth.particles(cloth.flat())
    performance = metrics.fold(cloth.arrays, bent, goal).performance
    # The mirror image of arc s is 2 R sin(s / R) away: its mean over a half is 4 R / pi.
    fine = np.linspace(0, np.pi / 2, 100001)
    place = np.column_stack([radius * np.sin(fine), radius * (1 - np.cos(fine))])
    flat = np.column_stack([radius * fine, np.full_like(fine, RADIUS)])
    moved = np.linalg.norm(place - flat, axis=1).mean()
    assert performance == pytest.approx(-(4 * radius / np.pi + 1.2 * moved), rel=0.03)


def test_flat_cloths_are_turned_by_up_to_45_degrees(fold):
    initializer = FlatCloth("fast")
    angles = np.rad2deg([initializer.angle(i) for i in range(NUM_VARIATIONS)])
    assert -45.0 <= angles.min() < -44.0 and 44.0 < angles.max() <= 45.0
    fold.reset(803)
    p1, _, p3, _ = fold.task.cloth.points()[fold.task.cloth.corners]
    assert np.rad2deg(np.arctan2(*(p3 - p1)[[1, 0]])) == pytest.approx(angles[803], abs=0.01)


def test_fold_cloth_starts_above_the_middle_of_the_first_column(fold):
    fold.reset(803)
    p1, p2 = fold.task.cloth.points()[fold.task.cloth.corners[:2]]
    pickers = fold.task.actor.positions()
    np.testing.assert_allclose(pickers.mean(axis=0)[:2], ((p1 + p2) / 2)[:2], atol=1e-12)
    np.testing.assert_allclose(pickers[:, 2], 0.1)
    low, high = fold.task.actor.limits
    # Both corners can be carried exactly onto their mirrors in every variation.
    np.testing.assert_allclose((high - low)[:2], 1.6)


# ---------------------------------------------------------------------------------------- dropping

# Integrals of docs/softgym.md 3.9: (dimx, x [m], height of the lower edge [m], performance).
IDEAL_DROPS = [
    (60, 0.0, 0.1, -0.3901), (60, 0.0, 0.2, -0.4459), (60, -0.1, 0.15, -0.4606),
    (60, 0.1, 0.15, -0.3657), (80, 0.0, 0.1, -0.4661), (80, 0.0, 0.2, -0.5426),
    (80, -0.1, 0.15, -0.5607), (80, 0.1, 0.15, -0.4586), (99, 0.0, 0.1, -0.5616),
    (99, 0.0, 0.2, -0.6359), (99, -0.1, 0.15, -0.6561), (99, 0.1, 0.15, -0.5497),
]  # fmt: skip


@pytest.mark.parametrize(("dimx", "x", "bottom", "expected"), IDEAL_DROPS)
def test_a_vertical_sheet_has_softgyms_initial_performance(drop, dimx, x, bottom, expected):
    env, task = drop, drop.task
    env.reset(800)
    task.cloth.resize((dimx, 70))
    env._recompile_physics_and_update_observables()
    along, across, _ = task.cloth.flat().T
    width = task.cloth.size[0]
    top = max(bottom + width, 0.5)
    height = top - width / 2 - along  # Column 0 on top.
    task.cloth.set_points(np.column_stack([np.full_like(along, x), across, height]))
    assert task.measure(task.state(), task.episode).performance == pytest.approx(expected, abs=2e-4)


def test_a_cloth_laid_flat_in_its_place_scores_one(drop):
    drop.reset(802)
    cloth = drop.task.cloth
    flat = cloth.flat(center=(cloth.size[0] / 2, 0.0))
    p1, p2, p3, _ = flat[cloth.corners]
    assert p1[0] == pytest.approx(0.0) and p1[1] == pytest.approx(-p2[1])
    assert p3[0] == pytest.approx(cloth.size[0])
    cloth.set_points(flat)
    info = measured(drop)
    assert info["normalized_performance"] == pytest.approx(1.0, abs=1e-9) and info["success"]
    cloth.set_points(flat + [0.3, 0.4, 0.0])
    assert measured(drop)["performance"] == pytest.approx(-0.5)


@pytest.mark.parametrize("task", DROP_TASKS)
def test_the_cloth_hangs_by_two_corners_that_the_pickers_hold(task):
    env = make(task)
    env.reset(801)
    cloth, actor = env.task.cloth, env.task.actor
    np.testing.assert_array_equal(actor.held, cloth.corners[:2])
    corners = cloth.points()[cloth.corners[:2]]
    np.testing.assert_allclose(actor.positions(), corners + [0.0, 0.0, 0.05], atol=1e-9)
    assert corners[0, 1] > 0.0 > corners[1, 1]  # p1 at +Y.
    lowest = cloth.points()[:, 2].min()
    for _ in range(3):
        env.step(np.tile([0.0, 0.0, 0.0, 1.0], 2))
    held = cloth.points()[cloth.corners[:2]]
    np.testing.assert_allclose(held, corners, atol=1e-3)
    assert cloth.points()[:, 2].min() == pytest.approx(lowest, abs=0.01)  # It was at rest.
    env.step(np.zeros(8))
    assert (actor.held == -1).all()
    for _ in range(10):
        env.step(np.zeros(8))
    assert cloth.points()[:, 2].max() < 0.4  # It fell.


def test_held_corners_stay_above_half_a_meter(drop):
    drop.reset(801)
    for _ in range(10):
        drop.step(np.tile([0.0, 0.0, -1.0, 1.0], 2))
    heights = drop.task.cloth.points()[drop.task.cloth.corners[:2], 2]
    np.testing.assert_allclose(heights, 0.5, atol=1e-3)
    low, high = drop.task.actor.limits
    np.testing.assert_allclose(low, [-0.25, -0.45, 0.55])
    np.testing.assert_allclose(high, [0.45, 0.45, 1.95])


@pytest.mark.parametrize(("sizes", "largest"), [((60, 100), 99), ((60, 120), 119)])
def test_hanging_cloths_are_drawn_from_the_facts(sizes, largest):
    initializer = HangingCloth("fast", sizes)
    dims = np.array([initializer.dims(i) for i in range(NUM_VARIATIONS)])
    assert dims.min() == 60 and dims.max() == initializer.size_range[1] - 1 == largest
    sheets = [initializer.sheet(i) for i in range(12)]
    for dim, sheet in zip(dims, sheets, strict=False):
        x, _, z = sheet[1:].T  # Vertex 0 is jittered.
        assert -0.1 <= x[0] <= 0.1 and np.ptp(x) < 1e-12
        width = (dim[0] - 1) * 0.00625
        assert z.max() - z.min() == pytest.approx(width)
        assert z.max() == pytest.approx(0.5) or 0.1 <= z.min() <= 0.2
        assert z.max() >= 0.5 - 1e-9
        jitter = sheet[0] - [x[0], sheet[1:, 1].max(), z.max()]
        assert 0.0 < jitter[0] < 1e-3 and jitter[0] == pytest.approx(jitter[2])


def test_a_dropped_cloth_needs_two_pickers():
    with pytest.raises(InvalidArgumentError, match="'picker', 'pick_and_place'"):
        make("drop_cloth", actor="pixel_pick_and_place")
