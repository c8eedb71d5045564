"""Unknowns of a simulation from recordings, by robust least squares, with 95 % intervals."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
from scipy.optimize import least_squares

from softgym_mj.exceptions import StoreError, check_count

FEWEST = 5  # Recordings: intervals need more of them than unknowns.
LARGE = 0.02  # [m] Residuals beyond count by their size, not their square.
_TWO_SIDED = 1.96  # Standard deviations of 95 % of a normal distribution.

Values = dict[str, float]
Item = TypeVar("Item")
Properties = TypeVar("Properties")


@dataclasses.dataclass(frozen=True)
class Unknown:
    """Bounds of an unknown, and the step of its logarithm for differences."""

    low: float
    high: float
    step: float


@dataclasses.dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes:
        values: Value of each unknown.
        intervals: 95 % interval of each, from the differences between recordings, within the
            bounds of the search.
    """

    values: Values
    intervals: dict[str, tuple[float, float]]


@dataclasses.dataclass(frozen=True)
class Identified(Generic[Properties]):
    """Result of an identification.

    Attributes:
        properties: Identified and assumed properties.
        intervals: 95 % interval of each unknown, from the differences between recordings, within
            the bounds of the search.
        recordings: Number of recordings.
        spacing: Measured lengths (n - 1,) [m] of a cable between n markers; () of a cloth.
    """

    properties: Properties
    intervals: dict[str, tuple[float, float]]
    recordings: int
    spacing: tuple[float, ...] = ()


def read_identified(kind: type[Properties], entry: Mapping[str, Any]) -> Identified[Properties]:
    """Returns the result with properties of a class of which `dataclasses.asdict` made an entry.

    Raises:
        StoreError: If it did not.
    """
    try:
        properties = kind(**entry["properties"])
        intervals = {name: (float(a), float(b)) for name, (a, b) in entry["intervals"].items()}
        spacing = tuple(map(float, entry.get("spacing", ())))
        return Identified(properties, intervals, int(entry["recordings"]), spacing)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise StoreError(f"it is no result of an identification: {error!r}") from error


def spread(recordings: Sequence[Item], number: int) -> list[Item]:
    """Returns some recordings, evenly spread: the middle one of each of `number` equal parts.

    Raises:
        InvalidArgumentError: If there are not so many, or `number` is less than 5.
    """
    check_count("recordings", number, FEWEST, len(recordings))
    return [recordings[int((i + 0.5) * len(recordings) / number)] for i in range(number)]


def fit(
    unknowns: Mapping[str, Unknown],
    starts: Sequence[Values],
    residuals_of: Callable[[Values], np.ndarray],
    evaluations: int,
) -> Fit:
    """Fits logarithms of the unknowns.

    Args:
        unknowns: Unknowns by name.
        starts: Values from the best of which the search starts.
        residuals_of: Returns residuals (recordings, k) [m].
        evaluations: Steps of the search.
    """
    bounds = np.log([[u.low for u in unknowns.values()], [u.high for u in unknowns.values()]])
    steps = np.array([unknown.step for unknown in unknowns.values()])

    def values(x: np.ndarray) -> Values:
        return dict(zip(unknowns, np.exp(x).tolist(), strict=True))

    def residuals(x: np.ndarray) -> np.ndarray:
        return residuals_of(values(x))

    @functools.lru_cache(maxsize=1)
    def last(x: tuple[float, ...]) -> np.ndarray:
        """Returns the residuals of the point at which SciPy asks for the Jacobian."""
        return residuals(np.array(x))

    def jacobian(x: np.ndarray) -> np.ndarray:
        """Returns derivatives (recordings k, unknowns) by differences."""
        base = last(tuple(x))
        moved = [residuals(x + step) - base for step in np.diag(steps)]
        return np.stack(moved, axis=-1).reshape(base.size, -1) / steps

    points = [np.log([start[name] for name in unknowns]) for start in starts]
    search = least_squares(
        lambda x: last(tuple(x)).ravel(),
        min(points, key=lambda x: float(np.abs(residuals(x)).mean())),
        jac=jacobian,
        bounds=bounds,
        x_scale=10.0 * steps,
        loss="soft_l1",
        f_scale=LARGE,
        max_nfev=evaluations,
    )
    number = len(last(tuple(search.x)))
    reach = _TWO_SIDED * _deviations(search.jac, search.fun, number)
    low, high = (values(np.clip(search.x + d, *bounds)) for d in (-reach, reach))
    return Fit(values(search.x), {name: (low[name], high[name]) for name in unknowns})


def _deviations(jacobian: np.ndarray, residuals: np.ndarray, recordings: int) -> np.ndarray:
    """Returns standard deviations (unknowns,) from the spread of gradients among recordings.

    Residuals of a recording are correlated, so that each recording counts as one observation: a
    sandwich of the inverse Hessian and the variance of gradients.

    Args:
        jacobian: (recordings k, unknowns), scaled for the loss as SciPy does.
        residuals: (recordings k,) [m].
        recordings: Number of recordings.
    """
    scaled = residuals * (1.0 + (residuals / LARGE) ** 2) ** 0.25
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    gradients = (jacobian * scaled[:, None]).reshape(recordings, -1, len(inverse)).sum(axis=1)
    variance = gradients.T @ gradients * recordings / (recordings - 1)
    return np.sqrt(np.diag(inverse @ variance @ inverse))
