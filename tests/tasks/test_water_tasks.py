"""TransportWater and PourWater against hand computations (docs/softgym.md 3.1, 3.2)."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.cup import Cup, CupSize
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.cup_mover import CupMover, CupTool, Track
from softgym_mj.tasks.shared.starts.cup_variations import Sample, TransportCups, transport_variation
from softgym_mj.tasks.shared.starts.settled_water import SettledWater, lattice
from softgym_mj.tasks.transport_water import LIQUID

VARIATION = 805  # Few particles in both tasks.


@pytest.fixture(name="transport", scope="module")
def _transport():
    return softgym_mj.load(
        "transport_water", split=[VARIATION], fidelity="fast", observation=["full", "reduced"]
    )


@pytest.fixture(name="pour", scope="module")
def _pour():
    return softgym_mj.load(
        "pour_water", split=[VARIATION], fidelity="fast", observation=["full", "reduced"]
    )


def scatter(env, fractions):
    """Puts fractions of the particles at points; returns how many there are at each."""
    water = env.task.water
    counts = np.round(np.array([f for f, _ in fractions]) * water.num_points).astype(int)
    counts[-1] = water.num_points - counts[:-1].sum()
    points = np.repeat([point for _, point in fractions], counts, axis=0)
    water.set_points(np.asarray(points, float))
    return counts


# ---------------------------------------------------------------- the mover


def test_transport_moves_by_its_limit_and_is_clipped_before_it_moves(transport):
    transport.reset(VARIATION)
    cup = transport.task.cup
    for action, x in ((1.0, 0.088), (-0.5, 0.044), (0.0, 0.044)):
        transport.step(np.array([action]))
        np.testing.assert_allclose(cup.pose, [x, 0, 0], atol=1e-15)
    for action, limit in ((1.0, 1.4), (-1.0, -0.25)):
        for _ in range(25):
            transport.step(np.array([action]))
        assert cup.pose[0] == limit  # SoftGym's walls go on by 0.011 m.
        assert transport.info()["rejected_moves"] == 0


def test_pour_moves_by_its_limits(pour):
    pour.reset(VARIATION)
    pour.step(np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(pour.task.cup.pose, [0, 0.08, 0], atol=1e-15)
    pour.step(np.array([-1.0, 0.5, 1.0]))
    np.testing.assert_allclose(pour.task.cup.pose, [-0.08, 0.12, 0.12], atol=1e-12)
    assert pour.info()["rejected_moves"] == 0
    pour.reset(VARIATION)  # An upright cup slides on the ground.
    for _ in range(3):
        pour.step(np.array([-1.0, 0.0, 0.0]))
    assert pour.info()["rejected_moves"] == 0
    np.testing.assert_allclose(pour.task.cup.pose, [-0.24, 0, 0], atol=1e-14)


@pytest.mark.parametrize(
    "action", [(0.0, -0.1, 0.0), (-1.0, -1.0, 0.0), (0.0, 0.0, 0.1), (-1.0, 0.0, -0.5)]
)
def test_a_move_into_the_ground_is_rejected_as_a_whole(pour, action):
    pour.reset(VARIATION)
    pour.step(np.array(action))
    np.testing.assert_array_equal(pour.task.cup.pose, [0, 0, 0])
    assert pour.info()["rejected_moves"] == 8
    pour.step(np.zeros(3))
    assert pour.info()["rejected_moves"] == 0


def test_a_tilt_is_rejected_just_where_the_lift_is_too_small(pour):
    """docs/softgym.md 3.2: theta needs a lift of (L/2) sin + (b/2) cos - b/2."""
    pour.reset(VARIATION)
    pour.step(np.array([0.0, 0.1, 0.0]))  # 8 mm.
    accepted = 0
    for k in range(1, 9):
        theta = 0.015 * k
        length, wall = pour.task.cup.size.length, pour.task.cup.size.wall
        lift = length / 2 * np.sin(theta) + wall / 2 * (np.cos(theta) - 1)
        accepted += lift <= 0.008
    pour.step(np.array([0.0, 0.0, 1.0]))
    assert 0 < accepted < 8
    assert pour.info()["rejected_moves"] == 8 - accepted
    assert pour.task.cup.pose[2] == pytest.approx(0.015 * accepted)


def test_a_move_into_the_target_is_rejected(pour):
    pour.reset(VARIATION)
    scene = pour.task.start.variation(pour.task.variation)
    steps = int(scene.gap / 0.01)  # Sim steps that fit into the gap.
    moved = 0
    for _ in range(steps // 8 + 2):
        pour.step(np.array([1.0, 0.0, 0.0]))
        moved += 8 - pour.info()["rejected_moves"]
    assert moved == steps
    assert pour.task.cup.pose[0] == pytest.approx(0.01 * steps)
    # Above the target it may pass.
    for _ in range(int(scene.target.height / 0.08) + 1):
        pour.step(np.array([0.0, 1.0, 0.0]))
    pour.step(np.array([1.0, 0.0, 0.0]))
    assert pour.info()["rejected_moves"] == 0


def test_the_cup_is_on_its_way_in_the_middle_of_a_sim_step():
    class Recorded(Cup):
        pose = np.zeros(3)

    cup = Recorded(CupSize(0.2, 0.2, 0.2, 0.045))
    mover = CupMover(CupTool(cup, (0.01, 0.0, 0.02), Track(-1.0, 1.0)))
    assert mover.action_size == 2
    mover.command(np.array([1.0, -0.5]))
    mover.plan()
    for fraction in (0.25, 0.5, 1.0):
        mover.move(fraction, 0.0025)
        np.testing.assert_allclose(cup.pose, [0.01 * fraction, 0, -0.01 * fraction])


def test_a_bad_action_is_told_what_the_cup_takes(pour):
    pour.reset(VARIATION)
    with pytest.raises(InvalidArgumentError, match=r"expected \(3,\): dx, dz, dtheta"):
        pour.step(np.zeros(8))


# ---------------------------------------------------------------- rewards


def test_transport_reward_by_hand(transport):
    transport.reset(VARIATION)
    task = transport.task
    assert transport.info()["performance"] == -1.2
    assert transport.info()["normalized_performance"] == 0.0
    task.cup.pose = np.array([0.6, 0.0, 0.0])
    scatter(transport, [(1.0, [0.6, 0.0, 0.05])])
    transport.step(np.zeros(1))
    # 5 % outside at the goal; 154 particles do not have that fraction exactly.
    task.cup.pose = np.array([1.2, 0.0, 0.0])
    counts = scatter(transport, [(0.05, [0.0, 0.0, 0.1]), (0.95, [1.2, 0.0, 0.05])])
    evaluation = task.measure(task.state(), task.episode)
    out = counts[0] / counts.sum()
    assert evaluation.performance == pytest.approx(-10 * out)
    assert evaluation.info["spilled"] == pytest.approx(out)
    assert 0.045 < out < 0.055
    task.cup.pose = np.array([0.6, 0.0, 0.0])
    scatter(transport, [(1.0, [0.6, 0.0, 0.05])])
    assert task.measure(task.state(), task.episode).performance == pytest.approx(-0.6)
    assert task.bounds(task.episode) == (-1.2, 0.0)  # Hence 0.5 normalized.


def test_pour_counts_what_is_in_the_target_and_not_in_the_cup(pour):
    pour.reset(VARIATION)
    task, scene = pour.task, pour.task.start.variation(pour.task.variation)
    assert pour.info()["performance"] == 0.0
    inside = [scene.distance, 0.0, 0.05]
    outside = [scene.distance, 0.0, scene.target.height + scene.target.wall]
    counts = scatter(pour, [(0.25, inside), (0.25, outside), (0.5, [0.0, 0.0, 0.05])])
    evaluation = task.measure(task.state(), task.episode)
    fractions = counts / counts.sum()
    assert evaluation.performance == evaluation.reward == pytest.approx(fractions[0])
    assert evaluation.info["spilled"] == pytest.approx(fractions[1])
    assert evaluation.info["fraction_in_cup"] == pytest.approx(fractions[2])
    # The cup lowered into the target: what is in both does not count.
    task.cup.pose = np.array([scene.distance, 0.0, 0.0])
    evaluation = task.measure(task.state(), task.episode)
    assert evaluation.performance == 0.0
    assert evaluation.info["fraction_in_target"] == pytest.approx(fractions[0])
    assert task.bounds(task.episode) == (0.0, 1.0)


# ---------------------------------------------------------------- states


def test_transport_states(transport):
    observation = transport.reset(VARIATION).observation
    water, size = transport.task.water, transport.task.cup.size
    positions = water.points()
    full = observation["full"]
    assert full.size == 3 * 4394 + 6  # Half of 8788.
    np.testing.assert_array_equal(full[: positions.size], positions.ravel())
    assert not full[positions.size : -6].any()
    np.testing.assert_array_equal(full[-6:], [0, 0, 0, size.length, size.width, size.height])
    expected = [0.0, size.length, size.width, size.height, positions[:, 2].max(), 1.0, 0.0]
    np.testing.assert_array_equal(observation["reduced"], expected)
    counts = scatter(transport, [(0.25, [9.0, 9.0, 0.7]), (0.75, [0.0, 0.0, 0.05])])
    out = counts[0] / counts.sum()
    np.testing.assert_allclose(transport.task.observe("reduced")[4:], [0.7, 1 - out, out])


def test_pour_states(pour):
    pour.reset(VARIATION)
    observation = pour.step(np.array([-0.5, 1.0, 0.25])).observation
    water, scene = pour.task.water, pour.task.start.variation(pour.task.variation)
    cup, target = scene.cup, scene.target
    positions = water.points()
    full = observation["full"]
    assert full.size == 3 * 4394 + 12
    assert not full[positions.size : -12].any()
    pose = [-0.04, 0.08, 0.03]
    cups = [*pose, cup.length, cup.width, cup.height,
            scene.distance, 0.0, 0.0, target.length, target.width, target.height]  # fmt: skip
    np.testing.assert_allclose(full[-12:], cups, atol=1e-14)
    expected = [*pose, cup.length, cup.width, cup.height, scene.distance, target.height,
                target.length, target.width, positions[:, 2].max(), 0.0, 1.0]  # fmt: skip
    np.testing.assert_allclose(observation["reduced"], expected, atol=1e-14)


# ---------------------------------------------------------------- initial states


def test_the_lattice_is_inside_the_cup_and_as_loose_as_it_says():
    for sample in (Sample(4, 14, 4), Sample(4, 16, 13), Sample(13, 52, 13), Sample(9, 31, 10)):
        scene = transport_variation(sample)
        for fidelity in ("fast", "default", "accurate"):
            resolution = scene.resolution(fidelity)
            points = lattice(scene.cup, resolution, np.random.default_rng(0))
            assert points.shape == (resolution.count, 3)
            half = np.array([scene.cup.length, scene.cup.width]) / 2
            # Half a spacing from the walls, less the noise and the rounding of the columns.
            margin = half - np.abs(points[:, :2]).max(axis=0)
            assert margin.min() > 0.4 * resolution.spacing
            assert points[:, 2].min() > scene.cup.wall / 2
            assert points[:, 2].max() < scene.cup.height
            # A full layer has the volume of its particles, 5 % more.
            columns = resolution.columns[0] * resolution.columns[1]
            level = scene.volume / (scene.cup.length * scene.cup.width)
            layers = np.ceil(resolution.count / columns)
            pitch = 1.05 * level / (resolution.count / columns)
            top = scene.cup.wall / 2 + (layers - 0.5) * pitch
            assert points[:, 2].max() == pytest.approx(top, abs=0.011 * resolution.spacing)


def test_settled_water_rests_in_the_cup_at_its_level():
    """The level of a liquid that fills the floor: volume / area above the floor's upper side."""
    settled = SettledWater(TransportCups(), LIQUID, "fast")
    scene = TransportCups().variation(VARIATION)
    spacing = scene.resolution("fast").spacing
    positions = settled.generate(VARIATION)
    level = scene.cup.wall / 2 + scene.volume / (scene.cup.length * scene.cup.width)
    surface = np.quantile(positions[:, 2], 0.98) + spacing / 2
    assert surface == pytest.approx(level, abs=0.3 * spacing)
    half = [scene.cup.length / 2, scene.cup.width / 2]
    assert np.all(np.abs(positions[:, :2]) < half) and positions[:, 2].min() > scene.cup.wall / 2
    np.testing.assert_array_equal(positions, settled.generate(VARIATION))


def test_particles_are_checked(transport):
    transport.reset(VARIATION)
    water = transport.task.water
    before = water.points()
    for bad in (before[1:], np.full_like(before, np.nan), before.ravel()):
        with pytest.raises(InvalidArgumentError, match="positions"):
            water.set_points(bad)
    with pytest.raises(InvalidArgumentError, match="velocities"):
        water.set_points(before, before[1:])
    for far in (2e4, -1e300, np.inf, np.nan):
        bad = before.copy()
        bad[5, 1] = far
        with pytest.raises(InvalidArgumentError, match=r"positions=.*-10000\.\.10000"):
            water.set_points(bad)
        with pytest.raises(InvalidArgumentError, match=r"velocities=.*-10000\.\.10000"):
            water.set_points(before, far)
    np.testing.assert_array_equal(water.points(), before)
    assert not np.shares_memory(before, water.points())
    water.set_points(before, 0.25)
    np.testing.assert_array_equal(water.velocities(), np.full_like(before, 0.25))


def test_nothing_passes_the_walls_at_the_first_move():
    """The cup moves from rest to full speed; a wall that is not swept would jump over particles."""
    env = softgym_mj.load("transport_water", split=[VARIATION], fidelity="fast", action_repeat=1)
    env.reset()
    size = env.task.cup.size
    for _ in range(3):
        env.step(np.ones(1))
        local = env.task.water.points() - [env.task.cup.pose[0], 0.0, 0.0]
        assert np.all(np.abs(local[:, 0]) < size.length / 2)
        assert np.all(np.abs(local[:, 1]) < size.width / 2)


def test_water_stays_at_rest_when_nothing_moves(transport):
    """Also right after a reset, where the cup has no previous pose to be swept from."""
    transport.reset(VARIATION)
    before = transport.task.water.points()
    for _ in range(10):
        transport.step(np.zeros(1))
    moved = np.linalg.norm(transport.task.water.points() - before, axis=1)
    assert np.median(moved) < 0.002
    assert transport.info()["spilled"] == 0.0
