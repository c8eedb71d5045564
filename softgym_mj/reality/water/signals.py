"""Comparison of signals over time: errors, and period and amplitude relative to a recorded one."""

import dataclasses

import numpy as np

STRETCH = 1.2  # Largest relative period that is tried; the smallest is its inverse.
_STEP = 0.001  # Between relative periods.


@dataclasses.dataclass(frozen=True)
class Likeness:
    """How an oscillation compares with a recorded one.

    Attributes:
        period: Relative period: the stretch of time, from 0 on, with which they correlate most.
        amplitude: Relative standard deviation.
    """

    period: float
    amplitude: float


def errors(simulated: np.ndarray, recorded: np.ndarray) -> tuple[float, float]:
    """Returns root mean square and mean of differences (n,)."""
    off = simulated - recorded
    return float(np.sqrt((off**2).mean())), float(off.mean())


def likeness(
    times: np.ndarray, simulated: np.ndarray, at: np.ndarray, recorded: np.ndarray
) -> Likeness:
    """Compares an oscillation with a recorded one.

    Args:
        times, simulated: (n,), up to `STRETCH` times the last recorded time.
        at, recorded: (m,) times and values.
    """
    stretches = np.arange(1.0 / STRETCH, STRETCH, _STEP)
    found = [np.corrcoef(np.interp(at * s, times, simulated), recorded)[0, 1] for s in stretches]
    same = np.interp(at, times, simulated)
    return Likeness(
        period=float(stretches[int(np.argmax(found))]), amplitude=float(same.std() / recorded.std())
    )
