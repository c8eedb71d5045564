"""Properties of a cable from its train recordings, by least squares, with 95 % intervals.

Only the ratios of stiffness and damping to mass show in motion: the density is assumed. Stretch is
too small to be seen.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from softgym_mj.exceptions import StoreError, check_count
from softgym_mj.reality.rope.cable import Properties
from softgym_mj.reality.rope.recordings import HELD, Recording
from softgym_mj.reality.rope.scenario import START_FRAMES, scenario_of
from softgym_mj.reality.rope.simulation import ASSUMED, CableSolver, marker_spacing

# Unknowns: bounds, and steps of their logarithms for differences.
UNKNOWNS = {
    "bend": (1e-5, 1e-1, 0.05),
    "bend_damping": (1e-3, 1.0, 0.05),
    "air_damping": (1e-4, 0.3, 0.1),
    "length": (0.95, 1.05, 0.002),
}
STARTS = (0.1, 1.0, 5.0)  # Stiffness relative to the assumed one, from which the best is taken.
EVALUATIONS = 8  # Steps of the search.
EVERY = 5  # Frames between those that are compared.
FEWEST = 5  # Recordings: intervals need more of them than unknowns.
LARGE = 0.02  # [m] Residuals beyond count by their size, not their square.
_TWO_SIDED = 1.96  # Standard deviations of 95 % of a normal distribution.


@dataclasses.dataclass(frozen=True)
class Identified:
    """Result of an identification.

    Attributes:
        properties: Identified and assumed properties.
        intervals: 95 % interval of each unknown, from the differences between recordings, within
            the bounds of the search.
        spacing: Measured lengths (n - 1,) [m] of the cable between n markers.
        recordings: Number of recordings.
    """

    properties: Properties
    intervals: dict[str, tuple[float, float]]
    spacing: tuple[float, ...]
    recordings: int

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> "Identified":
        """Returns the result of which `dataclasses.asdict` made an entry.

        Raises:
            StoreError: If it did not.
        """
        try:
            properties = Properties(**entry["properties"])
            found = {name: (float(a), float(b)) for name, (a, b) in entry["intervals"].items()}
            spacing = tuple(map(float, entry["spacing"]))
            return cls(properties, found, spacing, int(entry["recordings"]))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise StoreError(f"it is not an identified cable: {error!r}") from error


def spread(recordings: Sequence[Recording], number: int) -> list[Recording]:
    """Returns some recordings, evenly spread: the middle one of each of `number` equal parts.

    Raises:
        InvalidArgumentError: If there are not so many, or `number` is less than 5.
    """
    check_count("recordings", number, FEWEST, len(recordings))
    return [recordings[int((i + 0.5) * len(recordings) / number)] for i in range(number)]


def identify(
    recordings: Sequence[Recording], progress: Callable[[str], None] = lambda line: None
) -> Identified:
    """Identifies the unknowns from recordings of one cable.

    Args:
        recordings: Train recordings.
        progress: Receives a line for each evaluation.
    """
    spacing = marker_spacing(recordings)
    *bounds, steps = np.array(list(UNKNOWNS.values())).T

    @functools.lru_cache(maxsize=1)
    def last(x: tuple[float, ...]) -> np.ndarray:
        """Returns the residuals of the point at which SciPy asks for the Jacobian."""
        return residuals(np.array(x))

    def residuals(x: np.ndarray) -> np.ndarray:
        """Returns residuals (recordings, k) [m] of free markers at logarithms of the unknowns."""
        properties = _properties(x)
        solver = CableSolver("identification", spacing, properties)
        found = np.array([_residuals(solver, recording) for recording in recordings])
        values = ", ".join(f"{name} {getattr(properties, name):.4g}" for name in UNKNOWNS)
        progress(f"{values}: {1e3 * np.abs(found).mean():.2f} mm over free markers")
        return found

    def jacobian(x: np.ndarray) -> np.ndarray:
        """Returns derivatives (recordings k, unknowns) by differences."""
        base = last(tuple(x))
        moved = [residuals(x + step) - base for step in np.diag(steps)]
        return np.stack(moved, axis=-1).reshape(base.size, -1) / steps

    assumed = np.log([getattr(ASSUMED, name) for name in UNKNOWNS])
    starts = [assumed + np.eye(len(assumed))[0] * np.log(share) for share in STARTS]
    search = least_squares(
        lambda x: last(tuple(x)).ravel(),
        min(starts, key=lambda x: float(np.abs(residuals(x)).mean())),
        jac=jacobian,
        bounds=np.log(bounds),
        x_scale=10.0 * steps,
        loss="soft_l1",
        f_scale=LARGE,
        max_nfev=EVALUATIONS,
    )
    reach = _TWO_SIDED * _deviations(search.jac, search.fun, len(recordings))
    low, high = (_properties(np.clip(search.x + d, *np.log(bounds))) for d in (-reach, reach))
    intervals = {name: (getattr(low, name), getattr(high, name)) for name in UNKNOWNS}
    return Identified(_properties(search.x), intervals, tuple(spacing.tolist()), len(recordings))


def _properties(x: np.ndarray) -> Properties:
    """Returns the assumed properties with unknowns of logarithms (unknowns,)."""
    return dataclasses.replace(ASSUMED, **dict(zip(UNKNOWNS, np.exp(x).tolist(), strict=True)))


def _residuals(solver: CableSolver, recording: Recording) -> np.ndarray:
    """Returns residuals (k,) [m] of free markers in every few frames."""
    off = solver.predict(scenario_of(recording)) - recording.markers[START_FRAMES:]
    return np.delete(off, HELD, axis=1)[::EVERY].ravel()


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
