"""`CommandFilter`: turns abrupt commands into a path that arms can follow."""

from collections.abc import Callable

import numpy as np

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
Draw = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


class CommandFilter:
    """Points that follow commanded ones as fast as their acceleration limit allows.

    Attributes:
        commanded: commanded positions (n, 3) [m].
        points: filtered positions (n, 3) [m].
        step: their displacement in the current sim step (n, 3) [m].
    """

    def __init__(self, number: int, draw: Draw | None = None):
        """Starts with `number` points at rest at the origin.

        Args:
            number: number of points.
            draw: holds commanded points near the filter; None for `drawn_in`.
        """
        self._draw = drawn_in if draw is None else draw
        self.start(np.zeros((number, 3)))

    def start(self, points: np.ndarray) -> None:
        """Puts the points (n, 3) [m] at rest at their commanded positions."""
        self.commanded, self.points = np.array(points, float), np.array(points, float)
        self.step = np.zeros_like(self.points)

    def advance(self, wanted: np.ndarray, hold: Callable[[np.ndarray], np.ndarray]) -> None:
        """Runs a sim step towards points (n, 3) [m].

        Args:
            wanted: desired commanded points; the commanded points stay near the filter.
            hold: returns points (n, 3) [m] moved back to the largest allowed lead over the arms.
        """
        before = self.commanded
        self.commanded = self._draw(wanted, self.points, LEAD)
        along = drawn_in(self.commanded - before, np.zeros_like(before), ALONG * SIM_STEP)
        gap = self.commanded - along - self.points
        distance = np.sqrt(squares(gap))[:, None]
        braking = (np.sqrt(1.0 + 8.0 * distance / SPEED_UP) - 1.0) / 2.0 * SPEED_UP
        step = gap * (np.minimum(braking, distance) / np.maximum(distance, 1e-12))
        points = hold(self.points + drawn_in(along + step, self.step, SPEED_UP))
        self.step = points - self.points
        self.points = points

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the state for snapshots."""
        return {"filter": np.array([self.commanded, self.points, self.step])}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""
        self.commanded, self.points, self.step = state["filter"].copy()


def drawn_in(points: np.ndarray, centers: np.ndarray, radius: float) -> np.ndarray:
    """Returns points (n, 3), moved straight to within `radius` of their `centers` (n, 3)."""
    offset = points - centers
    distance = np.sqrt(squares(offset))[:, None]
    return centers + offset * (radius / np.maximum(distance, radius))
