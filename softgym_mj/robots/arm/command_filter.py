"""`CommandFilter`: turns abrupt commands into a path that arms can follow.

`advanced`, `drawn_in` and `clipped` are for arrays of NumPy, or of JAX in batches.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softgym_mj.metrics import Array, namespace
from softgym_mj.native.arithmetic import squares
from softgym_mj.robots.base import SIM_STEP

# [m/s^2] Commands may jump from -1 m/s to 1 m/s; the filtered path accelerates by at most this,
# within the arms' torques.
ACCELERATION = 10.0
SPEED_UP = ACCELERATION * SIM_STEP**2  # [m] Largest change of the displacement in a sim step.
# [m/s] Up to this speed the filter stays at the commanded point, instead of the distance from which
# it can stop there. When a command of 0.5 m/s ends at once, the filter overshoots by 10 mm (39 mm
# at 1 m/s); the hand, which follows it, by 19 mm (50 to 60 mm).
ALONG = 0.5
# [m] Largest distance of the commanded point from the filter. The hand is further behind: by up to
# `cartesian.LEAD` and the lag of the joints.
LEAD = 0.06


# Points (n, 3), moved to within a radius of their centers (n, 3).
Draw = Callable[[Array, Array, float], Array]


class Filter(NamedTuple):
    """State of a filter of n points.

    Attributes:
        commanded: commanded positions (n, 3) [m].
        points: filtered positions (n, 3) [m].
        step: their displacement in the current sim step (n, 3) [m].
    """

    commanded: Array
    points: Array
    step: Array


def advanced(state: Filter, wanted: Array, hold: Callable[[Array], Array], draw: Draw) -> Filter:
    """Returns the state after a sim step towards points (n, 3) [m].

    Args:
        state: state before.
        wanted: desired commanded points; the commanded points stay near the filter.
        hold: returns points (n, 3) [m] moved back to the largest allowed lead over the arms.
        draw: holds commanded points near the filter.
    """
    xp = namespace(wanted)
    commanded = draw(wanted, state.points, LEAD)
    along = drawn_in(commanded - state.commanded, xp.zeros_like(commanded), ALONG * SIM_STEP)
    gap = commanded - along - state.points
    distance = xp.sqrt(squares(gap))[:, None]
    braking = (xp.sqrt(1.0 + 8.0 * distance / SPEED_UP) - 1.0) / 2.0 * SPEED_UP
    step = gap * (xp.minimum(braking, distance) / xp.maximum(distance, 1e-12))
    points = hold(state.points + drawn_in(along + step, state.step, SPEED_UP))
    return Filter(commanded, points, points - state.points)


def drawn_in(points: Array, centers: Array, radius: float) -> Array:
    """Returns points (n, 3), moved straight to within `radius` of their `centers` (n, 3)."""
    xp, offset = namespace(points), points - centers
    distance = xp.sqrt(squares(offset))[:, None]
    return centers + offset * (radius / xp.maximum(distance, radius))


def clipped(points: Array, centers: Array, radius: float) -> Array:
    """Returns points (n, 3), each entry clipped to within `radius` of that of `centers` (n, 3)."""
    return namespace(points).clip(points, centers - radius, centers + radius)


class CommandFilter:
    """Points that follow commanded ones as fast as their acceleration limit allows.

    Attributes:
        commanded, points, step: as in `Filter`.
    """

    def __init__(self, number: int, draw: Draw = drawn_in):
        """Starts with `number` points at rest at the origin; `draw` is as in `advanced`."""
        self._draw = draw
        self.start(np.zeros((number, 3)))

    def start(self, points: np.ndarray) -> None:
        """Puts the points (n, 3) [m] at rest at their commanded positions."""
        self.commanded, self.points = np.array(points, float), np.array(points, float)
        self.step = np.zeros_like(self.points)

    def advance(self, wanted: np.ndarray, hold: Callable[[np.ndarray], np.ndarray]) -> None:
        """Runs a sim step towards points (n, 3) [m]; arguments are those of `advanced`."""
        state = Filter(self.commanded, self.points, self.step)
        self.commanded, self.points, self.step = advanced(state, wanted, hold, self._draw)

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the state for snapshots."""
        return {"filter": np.array([self.commanded, self.points, self.step])}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""
        self.commanded, self.points, self.step = state["filter"].copy()
