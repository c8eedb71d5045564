"""Motions of the rags of Blanco-Mulero et al.: two primitives as functions of time.

Both grippers move equally, in Y and Z, by consecutive quintic polynomials, each from the end of the
last to a given position, velocity and acceleration.
"""

import math

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, check_name

GRIPPER_X = (0.020, 0.498)  # [m] Left and right gripper.
START = (0.0, 1.0)  # [m] Y and Z.

# Duration [s], and position [m], velocity [m/s] and acceleration [m/s^2] at the end; None: at rest
# at the last end, whatever its acceleration.
Piece = tuple[float, tuple[float, float, float] | None]
PIECES: dict[str, tuple[tuple[Piece, ...], tuple[Piece, ...]]] = {
    "dynamic": (
        (
            (1.1, (-0.25, -0.7, 3.0)),
            (1.5, (0.30, 0.0, -1.0)),
            (1.3, (0.15, -0.3, -0.5)),
            (0.5, (-0.10, 0.0, 0.0)),
        ),
        (
            (1.1, (1.06, 0.0, 0.0)),
            (1.5, None),
            (1.3, (0.48949, 0.0, 0.02)),
            (0.5, None),
        ),
    ),
    "quasi_static": (
        ((1.0, None), (1.0, None), (12.0, (-0.60, 0.0, 0.0))),
        ((1.0, (0.95, 0.0, 0.0)), (1.0, None), (6.0, (0.68949, 0.0, 0.02)), (6.0, None)),
    ),
}


def duration(primitive: str) -> float:
    """Returns the duration of a primitive [s]."""
    check_name("primitive", primitive, PIECES)
    return math.fsum(length for length, _ in PIECES[primitive][0])


def gripper_positions(primitive: str, times: np.ndarray) -> np.ndarray:
    """Returns positions of both grippers (n, 2, 3) [m] at times (n,) [s] after the start.

    Before the start and after the end they stand still.

    Args:
        primitive: "dynamic", a fling onto the table, or "quasi_static", lowered and dragged.
        times: any finite times.

    Raises:
        InvalidArgumentError: for another primitive, or times that are not finite.
    """
    check_name("primitive", primitive, PIECES)
    times = np.asarray(times, float)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise InvalidArgumentError("times", times.shape, "finite, of a shape (n,)")
    times = np.clip(times, 0.0, duration(primitive))
    values = [_along(*axis, times) for axis in zip(START, PIECES[primitive], strict=True)]
    return _both(*values)


def _along(start: float, pieces: tuple[Piece, ...], times: np.ndarray) -> np.ndarray:
    """Returns positions (n,) [m] on one axis at times (n,) [s] within its pieces."""
    values, begin, state = np.full(len(times), start), 0.0, (start, 0.0, 0.0)
    for length, end in pieces:
        later = times >= begin
        values[later] = _piece(state, end, length, np.minimum(times[later] - begin, length))
        begin, state = begin + length, _after(state, end)
    return values


def _piece(
    state: tuple[float, float, float],
    end: tuple[float, float, float] | None,
    length: float,
    times: np.ndarray,
) -> np.ndarray:
    """Returns positions (n,) [m] of a piece, from a state to its end, at times (n,) [s]."""
    if end is None:
        return np.full(len(times), state[0])
    powers = length ** np.arange(3, 6.0)
    known = np.array([state[0], state[1], state[2] / 2.0])
    reached = np.array(
        [
            known @ [1.0, length, length**2],
            known @ [0.0, 1.0, 2.0 * length],
            known @ [0.0, 0.0, 2.0],
        ]
    )
    orders = np.arange(3, 6.0)
    matrix = np.array(
        [powers, orders * powers / length, orders * (orders - 1) * powers / length**2]
    )
    rest = np.linalg.solve(matrix, np.array(end) - reached)
    return np.polynomial.polynomial.polyval(times, np.concatenate([known, rest]))


def _after(
    state: tuple[float, float, float], end: tuple[float, float, float] | None
) -> tuple[float, float, float]:
    """Returns the state at the end of a piece."""
    return (state[0], 0.0, 0.0) if end is None else end


def _both(y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Returns positions (n, 2, 3) of both grippers for their Y and Z (n,)."""
    positions = np.empty((len(y), len(GRIPPER_X), 3))
    positions[..., 0] = GRIPPER_X
    positions[..., 1], positions[..., 2] = y[:, None], z[:, None]
    return positions
