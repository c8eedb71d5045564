"""Closed forms of the lab against others that are independent of them."""

import numpy as np
import pytest
import scipy.integrate

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.lab import theory

# Drop over width by load, as published curves of cantilevers have them.
PUBLISHED = {
    0.1: 0.0125, 0.5: 0.0624, 1.0: 0.1246, 2.0: 0.2467, 5.0: 0.5857, 10.0: 1.067, 20.0: 1.864,
    50.0: 3.706, 100.0: 5.888,
}  # fmt: skip


@pytest.mark.parametrize(("load", "ratio"), PUBLISHED.items())
def test_a_beam_hangs_as_published_curves_say(load, ratio):
    assert theory.drop_over_width(load) == pytest.approx(ratio, rel=2e-3)
    assert theory.load_of(theory.drop_over_width(load)) == pytest.approx(load, rel=1e-6)


@pytest.mark.parametrize("load", [0.3, 3.0, 30.0])
def test_a_beam_hangs_as_the_solution_of_its_boundary_value_problem(load):
    def slope(s, y):
        return np.vstack([y[1], -load * (1 - s) * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])])

    def ends(start, end):
        return np.array([start[0], end[1], start[2], start[3]])

    s = np.linspace(0.0, 1.0, 101)
    found = scipy.integrate.solve_bvp(slope, ends, s, np.vstack([s, 1 - s, s**2 / 2, s]), tol=1e-8)
    assert theory.drop_over_width(load) == pytest.approx(found.y[2, -1] / found.y[3, -1], rel=1e-3)


@pytest.mark.parametrize("load", [0.0, -1.0, 1e6, float("nan")])
def test_loads_beyond_the_curve_are_refused(load):
    with pytest.raises(InvalidArgumentError, match=r"load=.*\d+\.\.\d+"):
        theory.drop_over_width(load)


def test_little_swings_lose_four_thirds_of_their_square_in_the_air():
    """Of a'' + w^2 a + c a' |a'| = 0: averaged over a half swing, A - (4/3) c A^2."""
    density, drag, length, amplitude = 0.2, 1.0, 0.2, 0.05
    c = 0.375 * theory.AIR_DENSITY * drag * length / density
    expected = amplitude
    for _ in range(6):
        expected -= 4.0 / 3.0 * c * expected**2
    found = theory.swing_amplitude(density, drag, length, amplitude, 6)
    assert found == pytest.approx(expected, rel=0.01)
    assert found < 0.9 * amplitude


def test_drag_bears_the_weight_of_what_falls_evenly():
    speed = theory.terminal_speed(0.128, 1.2)
    drag = 0.5 * theory.AIR_DENSITY * 1.2 * speed**2
    assert drag == pytest.approx(0.128 * theory.GRAVITY)
