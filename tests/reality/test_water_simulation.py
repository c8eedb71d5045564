"""Water of the recordings against shallow water theory, linear waves, and comparisons by hand."""

import math

import numpy as np
import pytest

from softgym_mj.reality.water import dam_break, sloshing, spheric
from softgym_mj.reality.water.recordings import Series
from softgym_mj.reality.water.settings import SETTINGS
from softgym_mj.reality.water.tank import GRAVITY, Tank

WIDE = SETTINGS["wide kernel"]


def test_a_dam_break_is_that_of_ritter():
    """A long reservoir of depth h: 4/9 h at the gate, and a front slower than 2 sqrt(gh)."""
    layers, spacing = 10, 0.01
    depth = layers * spacing
    tank = Tank(1.6, (100, 5, layers), spacing, WIDE.liquid, gate=1.0, kernel="wide")
    tank.settle(0.8)
    while tank.data.time < 0.3:  # Waves have not reached the ends.
        tank.step()
    assert tank.level(1.0) == pytest.approx(4 / 9 * depth, rel=0.1)
    speed = (tank.positions[:, 0].max() - 1.0) / tank.data.time
    assert 1.3 < speed / math.sqrt(GRAVITY * depth) < 2.0


def test_small_waves_have_the_period_of_linear_theory():
    length, layers = 1.0, 14
    spacing = length / 28
    tank = Tank(length, (28, 6, layers), spacing, WIDE.liquid, kernel="wide")
    tilt = 0.1
    tank.model.opt.gravity[:] = [-GRAVITY * math.sin(tilt), 0, -GRAVITY * math.cos(tilt)]
    tank.settle(2.0)
    tank.model.opt.gravity[:] = [0, 0, -GRAVITY]
    times, means = [], []
    while tank.data.time < 3.0:
        tank.step()
        times.append(tank.data.time)
        means.append(tank.positions[:, 0].mean() - length / 2)
    signs = np.signbit(means)
    up = np.flatnonzero(signs[:-1] & ~signs[1:])
    passages = [np.interp(0, means[i : i + 2], times[i : i + 2]) for i in up]
    frequency = sloshing.natural_frequency(length, layers * spacing)
    assert np.diff(passages).mean() == pytest.approx(2 * math.pi / frequency, rel=0.03)


def test_levels_are_the_depth_everywhere():
    tank = Tank(0.4, (40, 6, 10), 0.01, WIDE.liquid)
    for x in (0.0, 0.003, 0.05, 0.2, 0.4):
        assert tank.level(x) == pytest.approx(0.1, rel=0.12)
    assert tank.level(0.2, 0.03) == pytest.approx(0.1, rel=0.03)
    tank.positions[:, 0] += 0.05  # Now the tank moves along.
    tank.data.mocap_pos[0, 0] = 0.05
    assert tank.level(0.2) == pytest.approx(0.1, rel=0.03)


def test_a_front_is_the_median_over_rows():
    rows = np.arange(8)
    positions = np.column_stack([rows * 0.1, (rows + 0.5) * 0.01, np.zeros(8)])
    assert dam_break.front(positions, 0.01) == pytest.approx(0.35 + 0.005)


def test_delays_and_errors_of_fronts_are_recovered():
    times = np.linspace(0, 5, 200)
    simulated, recorded = Series(times, 1 + times**2), np.array([1.0, 2.0, 3.0, 4.0])
    late = Series(recorded, 1 + (recorded - 0.2) ** 2)
    assert dam_break.best_delay(simulated, late) == pytest.approx(0.2, abs=0.011)
    high = Series(recorded, (1 + recorded**2) / 1.1)
    assert dam_break.error(simulated, high) == pytest.approx(0.1, rel=0.02)


def test_periods_amplitudes_and_heights_are_compared_as_worked_out_by_hand():
    recorded = Series(np.linspace(0, 10, 101), np.sin(2 * np.linspace(0, 10, 101)))
    times = np.linspace(0, 11, 2000)
    slow = Series(times, 0.8 * np.sin(2 * times / 1.03) + 0.5)
    period, amplitude, rest = sloshing.compare(slow, recorded)
    assert (period, amplitude) == pytest.approx((0.03, -0.2), abs=2e-3)
    assert rest < 0.01
    high = Series(recorded.times, recorded.values + 0.055)
    assert spheric.error(high, recorded) == pytest.approx(0.1)
