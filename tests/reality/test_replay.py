"""Replays of sheets against motions that are known in closed form."""

import math

import numpy as np
import pytest

from softgym_mj.cloth.fabrics import GRAVITY
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality import recorder as recorders
from softgym_mj.reality.meshes import Mesh, rectangle
from softgym_mj.reality.recorder import Recorder
from softgym_mj.reality.replay import Hold, replay

SHEET = rectangle(0.15, 0.09, 0.03)  # 6 x 4 vertices.
NO_AIR = Fabric(drag=0.0)


def raised(height, mesh=SHEET):
    return mesh.points + [0.0, 0.0, height]


def test_a_rectangle_is_what_it_says():
    assert len(SHEET.points) == 6 * 4
    assert len(SHEET.triangles) == 2 * 5 * 3
    assert SHEET.area == pytest.approx(0.15 * 0.09)
    np.testing.assert_allclose(SHEET.points[[0, 5]], [[-0.075, 0.045, 0], [0.075, 0.045, 0]])
    # Euler's formula of a disc: vertices - edges + triangles = 1.
    assert len(SHEET.points) - len(SHEET.edges) + len(SHEET.triangles) == 1
    assert SHEET.strain(SHEET.points * 1.1) == pytest.approx(0.1)


def test_a_sheet_falls_as_anything_without_air():
    times = np.array([0.0, 0.1, 0.205, 0.3])  # One between two steps.
    found = replay(SHEET, NO_AIR, [], times, start=raised(2.0))
    fall = 2.0 - found.positions[..., 2].mean(axis=1)
    # A substep moves by its last velocity: g t (t + h) / 2, with h = 0.4 ms.
    at_steps = GRAVITY * times * (times + 4e-4) / 2
    at_steps[2] = GRAVITY / 4 * (0.2 * (0.2 + 4e-4) + 0.21 * (0.21 + 4e-4))
    np.testing.assert_allclose(fall, at_steps, atol=1e-5)
    assert np.ptp(found.positions[..., 2], axis=1).max() < 1e-5
    assert not found.failures
    assert abs(found.strain_99) < 1e-4
    assert found.steps.times == pytest.approx(np.arange(1, 31) * 0.01)


def circle(times):
    """Two corners that keep their distance, on circles of 4 cm."""
    turn = 4.0 * np.asarray(times)
    way = 0.04 * np.stack([np.sin(turn), 0.0 * turn, 1.0 - np.cos(turn)], axis=1)
    return raised(0.5)[[0, 5]] + way[:, None]


def test_held_vertices_are_where_they_are_told_to_be():
    times = np.arange(0.0, 1.0, 1 / 30)
    found = replay(SHEET, Fabric(), [Hold((0, 5), circle)], times, start=raised(0.5))
    on_steps = np.isclose(times * 100, np.round(times * 100))
    np.testing.assert_allclose(
        found.positions[on_steps][:, [0, 5]], circle(times[on_steps]), atol=1e-6
    )
    # Between steps of 10 ms the chord is off by (4/s)^2 4 cm (5 ms)^2 / 2.
    np.testing.assert_allclose(found.positions[:, [0, 5]], circle(times), atol=1e-5)
    assert found.positions[-1, :, 2].min() < circle(times)[-1, 0, 2] - 0.08  # The rest hangs.
    assert 0.0 < found.strain_99 < 0.05
    assert found.milliseconds > 0.0


def test_what_is_let_go_of_falls_on():
    def rising(times):
        return raised(1.0)[None, :] + np.asarray(times)[:, None, None] * [0.0, 0.0, 0.5]

    hold = Hold(tuple(range(len(SHEET.points))), rising, end=0.1)
    times = np.array([0.1, 0.3])
    found = replay(SHEET, NO_AIR, [hold], times, start=raised(1.0))
    np.testing.assert_allclose(found.positions[0], raised(1.05), atol=1e-6)
    height = 1.05 + 0.5 * 0.2 - GRAVITY * 0.2 * (0.2 + 4e-4) / 2
    np.testing.assert_allclose(found.positions[1, :, 2], height, atol=1e-5)


def test_a_hand_that_is_followed_keeps_its_distance():
    def hand(times):
        return np.asarray(times)[:, None, None] * [[[0.2, 0.0, 0.1]]] + [9.0, 9.0, 9.0]

    hold = Hold((2,), hand, begin=0.1, follows=True)
    times = np.array([0.1, 0.5])
    found = replay(SHEET, Fabric(), [hold], times, start=raised(0.005))
    moved = found.positions[1, 2] - found.positions[0, 2]
    np.testing.assert_allclose(moved, [0.08, 0.0, 0.04], atol=1e-6)


def test_a_sheet_comes_to_lie_on_the_floor():
    found = replay(SHEET, Fabric(), [], np.array([1.0]), start=raised(0.32), floor=0.3)
    np.testing.assert_allclose(found.positions[0, :, 2], 0.305, atol=5e-4)
    assert found.lowest == pytest.approx(0.005, abs=1e-3)
    unbounded = replay(SHEET, Fabric(), [], np.array([1.0]), start=raised(0.32), floor=None)
    assert unbounded.positions[0, :, 2].max() < 0.0
    assert unbounded.lowest == math.inf


def test_begin_comes_before_what_is_asked_for():
    early = replay(SHEET, NO_AIR, [], np.array([0.0]), start=raised(1.0), begin=-0.2)
    late = replay(SHEET, NO_AIR, [], np.array([0.2]), start=raised(1.0))
    np.testing.assert_array_equal(early.positions, late.positions)


def test_the_same_bits_again():
    holds = [Hold((0, 5), circle)]
    first, second = (
        replay(SHEET, Fabric(), holds, np.array([0.5]), start=raised(0.5)) for _ in range(2)
    )
    assert first.positions.tobytes() == second.positions.tobytes()


def test_tearing_is_a_failure():
    def apart(times):
        way = np.asarray(times)[:, None, None] * [[[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]]]
        return raised(0.1)[[0, 5]] + way

    torn = replay(SHEET, Fabric(), [Hold((0, 5), apart)], np.array([0.3]), start=raised(0.1))
    (failure,) = torn.failures
    first = np.flatnonzero(torn.steps.strain_max > recorders.MOST_STRAIN)[0]
    assert failure.kind == recorders.STRAIN
    assert (failure.time, failure.value) == (torn.steps.times[first], torn.steps.strain_max[first])


def test_a_vertex_under_the_floor_is_a_failure():
    recorder = Recorder(SHEET, np.array([0.1]), floor=0.5)
    recorder.start(0.0, raised(0.5))
    for i in range(1, 11):
        sunk = raised(0.5)
        sunk[7, 2] -= i * 3e-3
        recorder.add(i * 0.01, sunk, 1.0)
    found = recorder.replay()
    (failure,) = found.failures
    assert failure.kind == recorders.UNDER_FLOOR
    assert (failure.time, failure.value) == pytest.approx((0.04, -0.012))
    assert found.lowest == pytest.approx(-0.03)


def test_a_recorder_stops_at_what_is_no_number():
    recorder = Recorder(SHEET, np.array([0.0, 0.5, 1.0, 3.0]))
    recorder.start(0.0, raised(1.0))
    assert recorder.add(1.0, raised(2.0), 3.0)
    assert not recorder.add(2.0, SHEET.points * np.nan, 3.0)
    found = recorder.replay()
    np.testing.assert_allclose(found.positions[:3, 0, 2], [1.0, 1.5, 2.0])
    assert np.isnan(found.positions[3]).all()
    assert [(f.kind, f.time) for f in found.failures] == [(recorders.NOT_FINITE, 2.0)]


def test_strain_of_steps_is_that_of_all_edges():
    recorder = Recorder(SHEET, np.zeros(0))
    recorder.start(0.0, SHEET.points)
    moved = SHEET.points + np.random.default_rng(0).normal(scale=1e-3, size=SHEET.points.shape)
    recorder.add(0.01, moved, 1.0)
    strains = []
    for a, b in SHEET.edges:
        rest = math.dist(SHEET.points[a], SHEET.points[b])
        strains.append(math.dist(moved[a], moved[b]) / rest - 1.0)
    steps = recorder.replay().steps
    assert steps.strain_max[0] == pytest.approx(max(strains))
    assert steps.strain_99[0] == pytest.approx(np.percentile(strains, 99))
    assert steps.lowest[0] == pytest.approx(moved[:, 2].min())


def still(times):
    return np.zeros((len(times), 1, 3))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": np.zeros((3, 3))}, "start"),
        ({"start": SHEET.points * np.nan}, "start"),
        ({"times": np.array([0.2, 0.1])}, "times"),
        ({"times": np.array([-0.1])}, "times"),
        ({"times": np.array([np.nan])}, "times"),
        ({"step": 0.0}, "step"),
        ({"holds": [Hold((99,), still)]}, r"holds\[0\].vertices"),
        ({"holds": [Hold((0,), circle)]}, r"holds\[0\].path"),
        ({"holds": [Hold((0,), still)]}, r"within 0.05 m of vertex 0"),
        ({"holds": [Hold((7,), still), Hold((7,), still, begin=1.0)]}, "once at a time"),
        ({"holds": [Hold((7,), still, begin=1.0, end=1.0)]}, "end"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, message):
    arguments = {"holds": [], "times": np.array([0.1])} | changes
    with pytest.raises(InvalidArgumentError, match=message):
        replay(SHEET, Fabric(), **arguments)


@pytest.mark.parametrize(
    ("points", "triangles", "message"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], "points"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "points"),
        (np.zeros((3, 3)), np.zeros((0, 3), int), "triangles"),
        (np.zeros((3, 3)), [[0.0, 1.0, 2.0]], "triangles"),
        (np.zeros((4, 3)), [[0, 1, 2]], "all 4 vertices"),
        (np.zeros((3, 3)), [[0, 1, 3]], "all 3 vertices"),
    ],
)
def test_no_mesh_is_refused(points, triangles, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Mesh(np.array(points), np.array(triangles))


@pytest.mark.parametrize("sides", [(0.0, 1.0, 0.1), (1.0, math.inf, 0.1), (1.0, 1.0, -0.1)])
def test_no_rectangle_is_refused(sides):
    with pytest.raises(InvalidArgumentError, match=r"width|depth|spacing"):
        rectangle(*sides)
