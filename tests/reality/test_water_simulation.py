"""Simulated dam breaks and sloshing tanks, and their gauges, against closed forms."""

import math

import numpy as np
import pytest

from softgym_mj.reality.water.comparison import EXPERIMENTS, PLAIN
from softgym_mj.reality.water.dam_breaks import DamBreak
from softgym_mj.reality.water.sloshing import Sloshing, natural_period
from softgym_mj.reality.water.tank import Box, Tank, depth, front

GRAVITY = 9.81  # [m/s^2]


def particles_under(surface, length, width, spacing):
    """Lattice points (n, 3) [m] below surface(x) [m]."""
    sites = [np.arange(math.ceil(size / spacing)) for size in (length, width, 1.0)]
    points = (np.stack(np.meshgrid(*sites, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * spacing
    points[:, 1] -= width / 2
    return points[points[:, 2] < surface(points[:, 0])]


def test_gauges_measure_ritters_dam_break():
    """A dam of height h breaks: h(x, t) = (2 c - x / t)^2 / 9 g up to x = 2 c t, c^2 = g h."""
    height, time, dam = 0.4, 0.2, 1.0
    c = math.sqrt(GRAVITY * height)

    def surface(x):
        u = np.clip((x - dam) / time, -c, 2 * c)
        return (2 * c - u) ** 2 / (9 * GRAVITY)

    spacing, width = 0.005, 0.04
    points = particles_under(surface, 2.5, width, spacing)
    # The tip is thinner than a particle where u > 2 c - 3 sqrt(g spacing / 2).
    thin = 3 * math.sqrt(GRAVITY * spacing / 2) * time
    ideal = dam + 2 * c * time
    assert ideal - thin - spacing <= front(points, spacing, width) <= ideal
    drop = points[:1] + [3.0, 0.0, 0.0]
    assert front(np.concatenate([points, drop]), spacing, width) < ideal
    for x in (0.2, 1.0, 1.3):
        found = depth(points, spacing, x, width)
        assert found == pytest.approx(float(surface(np.array(x))), abs=spacing)


def test_the_front_of_a_dam_break_approaches_ritters_speed():
    """The front accelerates to 2 sqrt(g h), and is no faster."""
    dam = DamBreak("", column=0.2, channel=9.0)
    run = dam.simulate(PLAIN, dam.depth / 12, 5.0)
    meters, seconds = run.values * dam.column, run.times * dam.unit
    speed = np.gradient(meters, seconds)
    ideal = 2 * math.sqrt(GRAVITY * dam.depth)
    assert (speed < 1.05 * ideal).all()
    assert 0.55 * ideal < np.median(speed[-10:]) < ideal
    assert run.values[0] == pytest.approx(1.0, abs=0.05)
    assert (np.diff(run.values) > -0.02).all()
    # At first it falls: a column's foot accelerates no faster than the column's top can.
    assert run.values[3] < 1.1


def test_water_in_a_tank_rests_at_its_depth():
    size, water = (0.6, 0.3, 0.5), Box((0.0, -0.15, 0.0), (0.6, 0.15, 0.3))
    tank = Tank(size, water, 0.03, PLAIN)
    points = tank.points
    assert 2 * points[:, 2].mean() == pytest.approx(0.3, rel=0.05)
    for across in (None, 0.3):
        assert depth(points, 0.03, 0.3, across) == pytest.approx(0.3, rel=0.1)
    tank.move(0.01)
    tank.step()
    assert tank.points[:, 0].min() > 0.0


def test_an_obstacle_and_a_gate_hold_water_back():
    box = Box((0.4, -0.05, 0.0), (0.5, 0.05, 0.1))
    water = Box((0.0, -0.1, 0.0), (0.2, 0.1, 0.2))
    tank = Tank((0.8, 0.2, 0.6), water, 0.02, PLAIN, (box,), gate=True)
    assert tank.points[:, 0].max() < 0.2
    tank.remove_gate()
    for _ in range(100):
        tank.step()
        points = tank.points
        assert not ((points > box.low) & (points < box.high)).all(axis=1).any()
    assert points[:, 0].max() > 0.6
    assert (points[:, 0] < 0.8).all()


def test_a_lifted_gate_lets_out_the_flow_of_a_sluice():
    """Flow per width under a gate: q^2 (1 + c / d) = c^2 2 g d, c = 0.611 of the opening."""
    opening, length, width = 0.06, 0.8, 0.06
    water = Box((0.0, -width / 2, 0.0), (length, width / 2, 0.3))
    tank = Tank((2.5, width, 0.6), water, 0.015, PLAIN, gate=True)
    steps = round(0.1 / tank.timestep)
    for step in range(steps):
        tank.lift_gate(opening * (step + 1) / steps)
        tank.step()
    held, passed = [], []
    for _ in range(round(0.2 / tank.timestep)):
        tank.step()
        x = tank.points[:, 0]
        volume = tank.spacing**3 / width
        held.append((x < length).sum() * volume / length)
        passed.append((x > length + 0.05).sum() * volume)
    late = len(held) // 4
    flow = np.polyfit(tank.timestep * np.arange(len(passed))[late:], passed[late:], 1)[0]
    behind, contracted = float(np.mean(held[late:])), 0.611 * opening
    ideal = contracted * math.sqrt(2 * GRAVITY * behind / (1 + contracted / behind))
    assert flow == pytest.approx(ideal, rel=0.15)


@pytest.mark.parametrize("size", [(0.5, 0.2, 0.3), (0.437, 0.113, 0.291)])
def test_particles_have_the_volume_of_the_water(size):
    water = Box((0.0, -size[1] / 2, 0.0), (size[0], size[1] / 2, size[2]))
    tank = Tank((0.6, size[1], 0.6), water, 0.05, PLAIN)
    assert len(tank.points) * tank.spacing**3 == pytest.approx(math.prod(size))
    assert tank.spacing == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize("starts_at_rest", [True, False])
def test_linear_waves_solve_their_equation(starts_at_rest):
    """The first mode: b'' + w^2 b = P x'' with the tank's acceleration, by small steps."""
    tank = Sloshing("", 1.73, 0.6, 0.032, 1.3, starts_at_rest, gauge=0.0)
    k = math.pi / tank.length
    own, drive = 2 * math.pi / natural_period(tank.length, tank.depth), 2 * math.pi / tank.period
    factor = 4 / math.pi * math.tanh(k * tank.depth)
    step, value, expected = 1e-4, 0.0, []
    # At full speed the tank starts with a jerk, which water follows at once.
    rate = 0.0 if starts_at_rest else factor * tank.amplitude * drive
    for i in range(60_000):
        expected.append(value)
        wave = math.cos if starts_at_rest else math.sin
        acceleration = -tank.amplitude * drive**2 * wave(drive * (i + 0.5) * step)
        rate += step * (-(own**2) * value + factor * acceleration)
        value += step * rate
    times = step * np.arange(len(expected))
    found = tank.linear(times, modes=1)
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_the_natural_period_has_the_limits_of_deep_and_shallow_water():
    deep = 2 * math.pi / math.sqrt(GRAVITY * math.pi)
    assert natural_period(1.0, 10.0) == pytest.approx(deep)
    assert natural_period(1.0, 1e-3) == pytest.approx(2 / math.sqrt(GRAVITY * 1e-3), rel=1e-4)
    # Half a second into a motion to the left water leaves the left end (Faltinsen 2000).
    assert EXPERIMENTS["faltinsen"].others(None, 1.0)["linear waves"].values[1000] < 0.0


def test_a_tank_that_moves_drives_its_water_as_linear_waves_predict():
    """Small waves over a quarter of a period, in which nothing is damped much."""
    tank = Sloshing("", 1.0, 0.5, 0.05, 1.1, starts_at_rest=True)
    run = tank.simulate(PLAIN, 0.05, 0.4)
    linear = tank.linear(run.times)
    lowest = np.argmin(linear)
    assert run.values[lowest] == pytest.approx(linear[lowest], rel=0.4)
