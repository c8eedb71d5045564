"""Closed-form solutions for sheets: the elastica, a hanging strip, drag, Coulomb friction."""

import functools
import math

import numpy as np
import scipy.integrate
import scipy.interpolate

from softgym_mj.exceptions import InvalidArgumentError

GRAVITY = 9.81  # [m/s^2]
AIR_DENSITY = 1.2  # [kg/m^3] As in the plugin.

# Slopes of the tip [rad] at which the elastica is tabulated: uniform from nearly straight to nearly
# upright, then ever closer to upright, where loads diverge.
_SLOPES = np.concatenate([np.linspace(0.002, 1.5, 60), np.pi / 2 - np.geomspace(0.06, 1e-6, 40)])


@functools.cache
def _elastica() -> tuple[np.ndarray, np.ndarray]:
    """Returns loads (n,) and drops over widths (n,) of clamped beams, both increasing.

    From the tip on, with lengths in (B / weight)^(1/3), the slope obeys a'' = -v cos a, a'(0) = 0.
    The clamp is where it is 0, and v^3 is the load, so no boundary value has to be searched for.
    """

    def slope(v, y):
        return [y[1], -v * math.cos(y[0]), math.sin(y[0]), math.cos(y[0])]

    def level(v, y):
        return y[0]

    level.terminal, level.direction = True, -1  # type: ignore[attr-defined]
    loads, ratios = [], []
    for angle in _SLOPES:
        start = [angle, 0.0, 0.0, 0.0]
        found = scipy.integrate.solve_ivp(
            slope, (0.0, 200.0), start, rtol=1e-9, atol=1e-11, events=level
        )
        loads.append(found.t[-1] ** 3)
        ratios.append(found.y[2, -1] / found.y[3, -1])
    return np.array(loads), np.array(ratios)


def drop_over_width(load: float) -> float:
    """Returns the drop of a clamped beam's tip over its horizontal reach.

    Args:
        load: weight per length times length^3 over bending stiffness, 0.02..500.
    """
    return _between(load, "load", *_elastica())


def load_of(drop_over_width: float) -> float:
    """Returns the load of the beam with this `drop_over_width`."""
    return _between(drop_over_width, "drop_over_width", *_elastica()[::-1])


def _between(value: float, name: str, x: np.ndarray, y: np.ndarray) -> float:
    if not x[0] <= value <= x[-1]:
        raise InvalidArgumentError(name, value, f"a number in {x[0]:.3g}..{x[-1]:.3g}")
    curve = scipy.interpolate.PchipInterpolator(np.log(x), np.log(y))
    return float(np.exp(curve(np.log(value))))


def hanging_strain(
    density: float, stretch: float, length: float, stiffening: float = 0.0, load: float = 0.0
) -> float:
    """Returns the mean strain of a strip under its own weight and a load at its end.

    Args:
        density: [kg/m^2]
        stretch: force per width and small strain [N/m].
        length: [m]
        stiffening: s of a force per width k e (1 + s e) at a strain e.
        load: load per width [N/m].
    """
    weight = density * GRAVITY * length
    if stiffening == 0.0:
        return (load + weight / 2.0) / stretch
    # With r^2 = 1 + 4 s T / k, the strain at a tension T is (r - 1) / (2 s). T is linear in place.
    end, top = (math.sqrt(1.0 + 4.0 * stiffening * t / stretch) for t in (load, load + weight))
    mean = (top * top + top * end + end * end) / (top + end) / 1.5
    return (mean - 1.0) / (2.0 * stiffening)


def terminal_speed(density: float, drag: float) -> float:
    """Returns the terminal speed [m/s] of a flat sheet that falls along its normal.

    Args:
        density: [kg/m^2]
        drag: drag coefficient.
    """
    return math.sqrt(2.0 * density * GRAVITY / (AIR_DENSITY * drag))


def swing_amplitude(
    density: float, drag: float, length: float, amplitude: float, half_swings: int
) -> float:
    """Returns the amplitude [rad] of a flat plate hanging from an edge after some half swings.

    Its angle obeys rho L^3/3 a'' = -rho g L^2/2 sin a - (1/2) rho_air C L^4/4 a' |a'|, per width.

    Args:
        density: rho [kg/m^2]
        drag: C.
        length: L [m]
        amplitude: initial amplitude [rad].
        half_swings: number of swings from one side to the other.
    """

    def slope(t, y):
        weight = 1.5 * GRAVITY / length * math.sin(y[0])
        air = 0.375 * AIR_DENSITY * drag * length / density * y[1] * abs(y[1])
        return [y[1], -weight - air]

    def stops(t, y):
        return y[1]

    longest = (half_swings + 2) * 2.0 * math.pi * math.sqrt(length / GRAVITY)
    found = scipy.integrate.solve_ivp(
        slope, (0.0, longest), [amplitude, 0.0], rtol=1e-9, atol=1e-11, events=stops
    )
    turns = found.y_events[0][found.t_events[0] > 1e-6]
    return abs(float(turns[half_swings - 1, 0]))
