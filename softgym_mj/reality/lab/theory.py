"""Closed forms that a sheet is compared with: the elastica, a hanging strip, drag, Coulomb."""

import functools
import math

import numpy as np
import scipy.integrate
import scipy.interpolate

from softgym_mj.exceptions import InvalidArgumentError

GRAVITY = 9.81  # [m/s^2]
AIR_DENSITY = 1.2  # [kg/m^3] As in the plugin.

# Slopes of the tip [rad] that the curve of the elastica is tabled at: evenly from nearly straight
# to nearly upright, and then ever closer to upright, where loads grow without end.
_SLOPES = np.concatenate([np.linspace(0.002, 1.5, 60), np.pi / 2 - np.geomspace(0.06, 1e-6, 40)])


@functools.cache
def _elastica() -> tuple[np.ndarray, np.ndarray]:
    """Loads (n,) and drops over widths (n,) of clamped beams, both rising.

    From the tip on, with lengths in (B / weight)^(1/3), the slope obeys a'' = -v cos a, a'(0) = 0.
    Where it is 0 there is the clamp, and v^3 the load: no boundary value has to be searched for.
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
    """By how much a clamped beam's tip hangs lower, over how far out it is.

    Args:
        load: weight per length times length^3 over bending stiffness, 0.02..500.
    """
    return _between(load, "load", *_elastica())


def load_of(drop_over_width: float) -> float:
    """The load of the beam that has this drop over width; see `drop_over_width`."""
    return _between(drop_over_width, "drop_over_width", *_elastica()[::-1])


def _between(value: float, name: str, x: np.ndarray, y: np.ndarray) -> float:
    if not x[0] <= value <= x[-1]:
        raise InvalidArgumentError(name, value, f"a number in {x[0]:.3g}..{x[-1]:.3g}")
    curve = scipy.interpolate.PchipInterpolator(np.log(x), np.log(y))
    return float(np.exp(curve(np.log(value))))


def hanging_strain(density: float, stretch: float, length: float) -> float:
    """Mean strain of a strip under its own weight.

    Args:
        density: [kg/m^2]
        stretch: force per width and strain [N/m].
        length: [m]
    """
    return density * GRAVITY * length / (2.0 * stretch)


def terminal_speed(density: float, drag: float) -> float:
    """Of a flat sheet that falls along its normal [m/s]: drag bears its weight.

    Args:
        density: [kg/m^2]
        drag: its coefficient.
    """
    return math.sqrt(2.0 * density * GRAVITY / (AIR_DENSITY * drag))


def swing_amplitude(
    density: float, drag: float, length: float, amplitude: float, half_swings: int
) -> float:
    """How far a flat plate that hangs from an edge swings out [rad] after some half swings.

    Its angle obeys rho L^3/3 a'' = -rho g L^2/2 sin a - (1/2) rho_air C L^4/4 a' |a'|, per width.

    Args:
        density: rho [kg/m^2]
        drag: C.
        length: L [m]
        amplitude: at which it is let go [rad].
        half_swings: from one side to the other.
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
