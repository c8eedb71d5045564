"""Identification: searches with known minima, clocks with known errors, sheets of known fabrics."""

import dataclasses
import functools
import json

import numpy as np
import pytest
from scipy.optimize import least_squares
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.parallel.executors import SerialExecutor
from softgym_mj.reality import rag_scene, rags
from softgym_mj.reality.identification import (
    confidence,
    identify,
    rag_data,
    synthetic,
    unknowns,
)
from softgym_mj.reality.identification.recordings import (
    FIT,
    MISSED,
    Clouds,
    Motion,
    Observation,
    Recording,
    camera_toward,
    spread,
)
from softgym_mj.reality.identification.search import Search, run_searches
from softgym_mj.reality.identification.surface import Surface
from softgym_mj.reality.identification.tasks import best_latency
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.primitives import gripper_positions
from softgym_mj.reality.replay import Hold, replay

SPACING = 0.08  # [m] Spacing of rags that simulate fast.
FABRIC = Fabric(density=0.2, drag=1.0, added_mass=0.1)
BOUNDS = np.array([[-3.0, 3.0]] * 3)
LEAST = np.array([0.5, -0.4, 1.0])
NOISE = 1e-3  # [m]
# Slopes of a fake's residuals, in 40 frames with two points each; the last coordinate has no
# effect.
SLOPES = np.random.default_rng(5).normal(size=(40, 6, 3)) * [0.01, 0.005, 0.0]


def fake(coordinates, noise=0):
    """Residuals [m] that bend, and are noise where they are least."""
    away = np.asarray(coordinates) - LEAST
    random = np.random.default_rng(noise)
    return (SLOPES @ (away + 0.1 * away**2) + NOISE * random.normal(size=(40, 6))).tolist()


def searched(folder=None, seeds=(0, 1), function=fake):
    searches = {seed: Search(np.zeros(3), BOUNDS, seed) for seed in seeds}
    journals = {}
    if folder is not None:
        store = identify.open_store(folder, {"what": "a test"})
        journals = {seed: store.journal(seed) for seed in seeds}
    run_searches(searches, lambda seed, x, is_finer: (x,), function, SerialExecutor(), journals)
    return [search.result() for search in searches.values()]


def exact(coordinates):
    away = np.asarray(coordinates) - LEAST
    return (SLOPES @ (away + 0.1 * away**2)).tolist()


def test_searches_end_where_a_solver_of_the_same_equations_does():
    least = least_squares(lambda x: np.ravel(fake([*x, 0.0])), [0.0, 0.0]).x
    for found in searched():
        np.testing.assert_allclose(found.estimate[:2], least, atol=0.02)
        assert found.loss == pytest.approx(NOISE, rel=0.2)
        assert abs(found.estimate[2]) < 2.0  # Nothing led it away from the start, 0.
        assert found.evaluations <= 240


def test_without_noise_a_search_finds_the_truth_and_ends_early():
    for found in searched(function=exact):
        np.testing.assert_allclose(found.estimate[:2], LEAST[:2], atol=2e-3)
        assert found.evaluations < 60


def test_a_search_ends_at_the_edge_beyond_which_the_least_is():
    narrow = np.array([[-3.0, 0.2], [-3.0, 3.0], [-3.0, 3.0]])
    search = Search(np.zeros(3), narrow, 0)
    run_searches({0: search}, lambda seed, x, is_finer: (x,), fake, SerialExecutor())
    assert search.result().estimate[0] == pytest.approx(0.2, abs=1e-2)
    with pytest.raises(InvalidArgumentError, match="evaluations"):
        Search(np.zeros(3), BOUNDS, 0, 150)


def test_in_the_end_a_finer_mesh_says_where_offsets_are_least():
    """The coarse one's are least elsewhere, and its slopes are a tenth too small."""
    asked = []

    def meshes(coordinates, is_finer):
        asked.append(is_finer)
        if is_finer:
            return fake(coordinates)
        return fake(LEAST + 0.9 * (np.asarray(coordinates) - LEAST - [0.3, -0.2, 0.0]))

    least = least_squares(lambda x: np.ravel(fake([*x, 0.0])), [0.0, 0.0]).x
    errors = []
    for refinements in range(3):
        search = Search(np.zeros(3), BOUNDS, 0, refinements=refinements)
        run_searches({0: search}, lambda seed, *at: at, meshes, SerialExecutor())
        errors.append(np.abs(search.result().estimate[:2] - least).max())
        assert sum(asked) == refinements and not any(asked[: len(asked) - refinements])
        asked.clear()
    assert errors[0] > 0.25 and errors[1] < 0.1 and errors[2] < 0.02


def test_no_finer_mesh_is_asked_for_where_offsets_are_met():
    search = Search(np.zeros(3), BOUNDS, 0, refinements=2)

    def met(coordinates, is_finer):
        assert not is_finer
        return exact(coordinates)

    run_searches({0: search}, lambda seed, *at: at, met, SerialExecutor())
    np.testing.assert_allclose(search.result().estimate[:2], LEAST[:2], atol=2e-3)


def test_a_surface_is_least_where_offsets_are_but_for_those_that_jump():
    random = np.random.default_rng(3)
    points = LEAST + 0.3 * random.standard_normal((72, 3))
    residuals = np.array([np.ravel(exact(point)) for point in points])
    frames = np.repeat(np.arange(40), 6)
    smooth = Surface(points, residuals, frames)
    np.testing.assert_allclose(smooth.minimum(BOUNDS)[:2], LEAST[:2], atol=1e-6)
    beside = LEAST + [0.1, -0.2, 0.0]
    np.testing.assert_allclose(smooth.residuals(beside), np.ravel(exact(beside)) / NOISE, atol=1e-6)
    above, below = (smooth.residuals(beside + [h, 0, 0]) for h in (1e-6, -1e-6))
    numeric = (above - below) / 2e-6
    np.testing.assert_allclose(smooth.jacobian(beside)[:, 0], numeric, atol=1e-4)
    # The last ten frames have noise of 2 cm: a hundredth of the weight of others.
    residuals[:, frames >= 30] += 0.02 * random.standard_normal((72, 60))
    rough = Surface(points, residuals, frames)
    np.testing.assert_allclose(rough.minimum(BOUNDS)[:2], LEAST[:2], atol=0.02)
    alike = Surface(points, residuals, np.zeros(len(frames), int))
    error, other = (np.abs(each.minimum(BOUNDS)[:2] - LEAST[:2]).max() for each in (rough, alike))
    assert other > 3 * error


def test_intervals_are_those_of_least_squares_and_wide_where_nothing_shows():
    matrix = SLOPES.reshape(-1, 3)[:, :2]
    expected = 1.96 * NOISE * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    halves, covered = [], []
    for noise in range(30):
        (found,) = searched(seeds=(0,), function=functools.partial(fake, noise=noise))
        low, high = confidence.intervals([found], found.estimate, BOUNDS, [25, 15]).T
        halves.append((high - low)[:2] / 2.0)
        covered.append((low[:2] < LEAST[:2]) & (LEAST[:2] < high[:2]))
        np.testing.assert_array_equal([low[2], high[2]], BOUNDS[2])
    np.testing.assert_allclose(np.mean(halves, axis=0), expected, rtol=0.25)
    assert np.mean(covered) > 0.8  # 0.95, of 8 blocks a little less.


def test_what_only_roughness_shows_is_not_identified():
    def rough(coordinates):
        """Its noise is another at each place, so that slopes through it are none of its own."""
        random = np.random.default_rng(np.abs(np.array(coordinates) * 1e9).astype(int))
        return (np.array(exact(coordinates)) + 2 * NOISE * random.normal(size=(40, 6))).tolist()

    (found,) = searched(seeds=(0,), function=rough)
    ranges = confidence.intervals([found], found.estimate, BOUNDS, [25, 15])
    np.testing.assert_array_equal(ranges[2], BOUNDS[2])
    assert np.all(ranges[:2, 0] < LEAST[:2]) and np.all(LEAST[:2] < ranges[:2, 1])
    np.testing.assert_allclose(found.estimate[:2], LEAST[:2], atol=0.1)
    blind = dataclasses.replace(found, spurious=np.zeros((3, 3)))
    low, high = confidence.intervals([blind], found.estimate, BOUNDS, [25, 15])[2]
    assert high - low < 3.0  # It would be believed.


def test_intervals_hold_how_searches_differ():
    (found,) = searched(seeds=(0,))
    other = dataclasses.replace(found, estimate=found.estimate + [0.5, 0.0, 0.0])
    alone, both = (
        confidence.intervals(each, found.estimate, BOUNDS, [25, 15])
        for each in ([found], [found, other])
    )
    assert both[0, 1] - both[0, 0] > 2 * 1.96 * 0.5 / np.sqrt(2.0)
    np.testing.assert_array_equal(alone[1], both[1])


def test_a_search_goes_on_from_its_journal_with_the_same_bits(tmp_path):
    whole = searched(tmp_path / "whole")
    calls = []

    def stopped(coordinates):
        calls.append(coordinates)
        if len(calls) > 40:
            raise KeyboardInterrupt
        return fake(coordinates)

    with pytest.raises(KeyboardInterrupt):
        searched(tmp_path / "parts", function=stopped)
    calls.clear()

    def counted(coordinates):
        calls.append(coordinates)
        return fake(coordinates)

    parts = searched(tmp_path / "parts", function=counted)
    for first, second in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(first.estimate, second.estimate)
        np.testing.assert_array_equal(first.jacobian, second.jacobian)
    # The first 12 of both searches, and twice three slopes and a step, were stored.
    assert len(calls) == sum(each.evaluations for each in whole) - 40
    with pytest.raises(StoreError, match="what"):
        identify.open_store(tmp_path / "parts", {"what": "another"})


def test_coordinates_and_values_belong_to_each_other():
    values = unknowns.values_of(FABRIC, 0.033)
    assert values["bending"] == pytest.approx(FABRIC.bend_stiffness / 0.2)
    back = unknowns.values_at(unknowns.coordinates_of(values))
    assert back == pytest.approx(values)
    sheet = unknowns.fabric_of(values, dataclasses.replace(FABRIC, drag=0.3, bend_stiffness=1e-6))
    assert dataclasses.asdict(sheet) == pytest.approx(dataclasses.asdict(FABRIC))
    plate = Fabric.named("black_denim", anisotropic=True)
    other = unknowns.fabric_of(unknowns.values_of(plate.bent(1e-5), 0.0), plate)
    assert dataclasses.asdict(other.bent(plate.bend_stiffness)) == pytest.approx(
        dataclasses.asdict(plate) | {"added_mass": other.added_mass}
    )
    with pytest.raises(InvalidArgumentError, match="latency"):
        unknowns.coordinates_of({"bending": 1e-5})


def test_only_ratios_to_the_density_show():
    scene = rag_data.RagScene("dynamic", 0.8, spacing=0.08)
    values = unknowns.values_of(FABRIC, 0.0)
    heavy = dataclasses.replace(FABRIC, density=0.3)
    light, same = (
        scene.motion(unknowns.fabric_of(values, base)).positions for base in (FABRIC, heavy)
    )
    other = scene.motion(dataclasses.replace(FABRIC, density=0.3)).positions
    assert np.abs(light - same).max() < 1e-4
    assert np.abs(light - other).max() > 3e-3


def hem(spacing, by_area):
    """Returns the middle (10, 3) [m] of a rag's hem while it is flung, for a mesh."""
    mesh = rag_data.RagScene("dynamic", 1.0, spacing=spacing).mesh
    hold = Hold(rag_scene.corners(mesh), lambda t: gripper_positions("dynamic", t))
    times, start = np.arange(1.5, 2.5, 0.1), rag_scene.hung(mesh)
    done = replay(mesh, FABRIC, [hold], times, start=start, by_area=by_area)
    return done.positions[:, np.isclose(mesh.points[:, 1], mesh.points[:, 1].min())].mean(axis=1)


def test_with_masses_by_area_a_coarse_mesh_swings_as_a_fine_one():
    """Else its rim is too heavy, the more so the coarser it is."""
    fine = hem(0.0263, by_area=True)
    by_area, alike = (
        np.linalg.norm(hem(0.05, by_area=each) - fine, axis=1).mean() for each in (True, False)
    )
    assert by_area < 0.6 * alike


class Vertices(Observation):
    """Vertices that are seen themselves, at places (f, n, 3) [m]."""

    def __init__(self, places):
        self.places = places

    def distances(self, positions, chosen=slice(None)):
        return np.linalg.norm(self.places[chosen] - positions, axis=2).mean(axis=1)

    def residuals(self, positions):
        return self.places - positions


class Swinging:
    """A sheet of three points that swing, and what was seen of it."""

    def __init__(self, late):
        times = np.arange(0.0, 3.0, 0.01)
        self.motion = Motion(times, self.places(times))
        frames = np.arange(0.0, 2.9, 1 / 30)
        seen = Vertices(self.places(np.maximum(frames - late, 0.0)))
        self.recording = Recording("swinging", FIT, "swing", frames, seen)

    @staticmethod
    def places(times):
        way = 0.2 * np.sin(4.0 * times)[:, None] + 0.1 * np.sin(7.0 * times + 1.0)[:, None]
        across = way + [0.0, 0.1, 0.2]
        return np.stack([across, 0.3 * across, 0.0 * across], axis=2)


@pytest.mark.parametrize("late", [0.033, 0.474, -0.2])
def test_a_clock_that_is_off_is_found(late):
    case = Swinging(max(late, 0.0))
    if late < 0.0:  # Its frames are early.
        shown = case.places(case.recording.times - late)
        case.recording = dataclasses.replace(case.recording, observation=Vertices(shown))
    assert best_latency([case.recording], [case.motion]) == pytest.approx(late, abs=1.5e-3)
    least = case.recording.distances(case.motion, late)[12:-12].max()
    assert least < 1e-3


def test_distances_from_clouds_are_of_what_a_camera_sees():
    mesh = rectangle(0.4, 0.4, 0.02)
    lower, upper = mesh.points + [0.0, 0.0, 0.1], mesh.points + [0.0, 0.0, 0.3]
    random = np.random.default_rng(1)
    cloud = random.uniform([-0.2, -0.2, 0.3], [0.2, 0.2, 0.3], (3000, 3))
    above = camera_toward((0.0, 0.0, 2.0), [cloud])
    near = Clouds([cloud], mesh, above).distances(upper[None])[0]
    assert near < 0.5 * 0.007  # Half the way from a vertex to the nearest of so many points.
    assert Clouds([cloud], mesh, None).distances(upper[None])[0] < 1e-6
    assert Clouds([cloud], mesh, above).distances(lower[None])[0] == pytest.approx(0.2, abs=2e-3)
    # Half of the sheet is folded under: what the camera does not see does not count.
    folded = upper.copy()
    under = folded[:, 0] > 0.0
    folded[under, 0] *= -1.0
    folded[under, 2] -= 0.05
    half = cloud[cloud[:, 0] < 0.0]
    seen = Clouds([half], mesh, above).distances(folded[None])[0]
    assert seen < 0.007
    np.testing.assert_array_equal(spread(5), np.arange(5))
    assert list(spread(100, 3)) in ([0, 49, 99], [0, 50, 99])


def test_offsets_from_clouds_are_of_patches_and_cancel_noise():
    mesh = rectangle(0.4, 0.4, 0.02)
    random = np.random.default_rng(1)
    cloud = random.uniform([-0.19, -0.19, 0.0], [0.19, 0.19, 0.0], (400, 3))
    moved = mesh.points + [0.0, 0.0, 0.01]
    seen = Clouds([cloud, cloud + 0.005 * random.normal(size=cloud.shape)], mesh, None)
    exact, noisy = seen.residuals(np.stack([moved, moved]))
    np.testing.assert_allclose(exact, np.tile([0.0, 0.0, -0.01], (16, 1)), atol=1e-7)
    # Means of 25 points each; rims add displacements within the plane.
    assert np.abs(noisy[:, 2] + 0.01).max() < 4 * 0.005 / 5
    assert np.std(noisy[:, 2]) == pytest.approx(0.005 / 5, rel=0.5)
    empty = Clouds([np.zeros((0, 3))], mesh, None)
    assert not empty.residuals(moved[None]).any()


def test_offsets_of_what_went_wrong_are_large():
    case = Swinging(0.0)
    broken = case.motion.positions.copy()
    broken[100:] = np.nan
    residuals = case.recording.residuals(Motion(case.motion.times, broken), 0.0)
    late = case.recording.times >= 1.0
    assert np.all(residuals[late] == MISSED)
    assert np.abs(residuals[case.recording.times < 0.99]).max() < 1e-4


def test_synthetic_rags_are_read_as_they_were_written(tmp_path, monkeypatch):
    monkeypatch.setattr(rags, "FRAMES", {"dynamic": 6})
    monkeypatch.setattr(rags, "FRAMES_BEFORE_CONTACT", {"linen": (5, 5, 5)})
    sensor = synthetic.Sensor(latency=0.0, noise=0.0)
    synthetic.write_rags(
        tmp_path, "linen", FABRIC, sensor, 0.08, 0.01, (0, 1), {(1, "dynamic"): 0.1}
    )
    scenes, found = rag_data.read_rags(tmp_path, "linen", spacing=0.08, camera=synthetic.CAMERA)
    assert [(r.name, r.role) for r in found] == [
        ("linen_0/dynamic", "fit"),
        ("linen_1/dynamic", "held out"),
    ]
    motion = scenes["dynamic"].motion(FABRIC)
    first, second = (r.distances(motion, 0.0) for r in found)
    assert np.all(first < 0.007)  # What clouds of some points have of vertices between them.
    np.testing.assert_allclose(found[0].times, np.arange(5) / 30)
    assert second.mean() == pytest.approx(first.mean(), rel=0.1)  # It hardly moves at first.
    with pytest.raises(StoreError, match="repeat 0 is missing"):
        rag_data.read_rags(tmp_path, "cotton")


@pytest.mark.long
def test_drag_is_recovered_by_the_command(tmp_path, monkeypatch):
    monkeypatch.setattr(rags, "FRAMES", {"dynamic": 46})  # Up to 1.5 s it hardly crumples.
    monkeypatch.setattr(rags, "FRAMES_BEFORE_CONTACT", {"linen": (46, 46, 46)})
    secret = dataclasses.replace(
        Fabric.named("white_dots"), density=0.2, drag=2.0, added_mass=0.2, stretch_stiffness=400.0,
        thickness=unknowns.THICKNESS,
    )  # fmt: skip
    sensor = synthetic.Sensor(latency=0.0, noise=0.0)
    synthetic.write_rags(tmp_path, "linen", secret, sensor, SPACING, 0.01, (0, 1))
    out = tmp_path / "out"
    arguments = [
        "identify", "rags", str(tmp_path), "--density", "0.2", "--spacing", str(SPACING),
        "--seeds", "1", "--evaluations", "160", "--out", str(out),
    ]  # fmt: skip
    result = CliRunner().invoke(commands.app, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    found = json.loads((out / "identification.json").read_text())
    drag = found["parameters"]["drag"]
    assert drag["value"] == pytest.approx(2.0 / secret.density, rel=0.01)
    added = found["parameters"]["added_mass"]["value"]
    assert added == pytest.approx(0.2 / secret.density, rel=0.01)
    assert "friction" in found["not_identified"]  # Nothing touches the table.
    assert list(found["held_out"]["recordings"]) == ["linen_1/dynamic"]
    assert found["held_out"]["found"] < 0.5 * found["held_out"]["start"]
    assert not any(clock["is_clock_off"] for clock in found["clocks"].values())
    assert json.loads((out / "fabric.json").read_text())["drag"] == pytest.approx(
        drag["value"] * secret.density
    )


def test_parameters_replace_those_of_the_fabric(tmp_path):
    (tmp_path / "fabric.json").write_text('{"bend_stiffness": 3e-5, "softness": 1.0}')
    arguments = ["identify", "rags", str(tmp_path), "--parameters", str(tmp_path / "fabric.json")]
    result = CliRunner().invoke(commands.app, arguments)
    assert isinstance(result.exception, InvalidArgumentError)
    assert "softness" in str(result.exception) and "thickness" in str(result.exception)


def test_what_is_missing_is_said(tmp_path):
    result = CliRunner().invoke(commands.app, ["identify", "rags", str(tmp_path / "none")])
    assert "repeat 0 is missing" in str(result.exception)
