"""Properties of a cable from its train recordings, by least squares, with 95 % intervals.

Only the ratios of stiffness and damping to mass show in motion: the density is assumed. Stretch is
too small to be seen.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from softgym_mj.exceptions import check_count
from softgym_mj.reality.fitting import FEWEST, Identified, Unknown, fit
from softgym_mj.reality.rope.cable import Properties
from softgym_mj.reality.rope.recordings import HELD, Recording
from softgym_mj.reality.rope.scenario import START_FRAMES, scenario_of
from softgym_mj.reality.rope.simulation import ASSUMED, CableSolver, marker_spacing

UNKNOWNS = {
    "bend": Unknown(1e-5, 1e-1, 0.05),
    "bend_damping": Unknown(1e-3, 1.0, 0.05),
    "air_damping": Unknown(1e-4, 0.3, 0.1),
    "length": Unknown(0.95, 1.05, 0.002),
}
STARTS = (0.1, 1.0, 5.0)  # Stiffness relative to the assumed one, from which the best is taken.
EVALUATIONS = 8  # Steps of the search.
EVERY = 5  # Frames between those that are compared.


def identify(
    recordings: Sequence[Recording], progress: Callable[[str], None] = lambda line: None
) -> Identified[Properties]:
    """Identifies the unknowns from recordings of one cable.

    Args:
        recordings: Train recordings.
        progress: Receives a line for each evaluation.

    Raises:
        InvalidArgumentError: If there are fewer recordings than intervals need.
    """
    check_count("recordings", len(recordings), FEWEST)
    spacing = marker_spacing(recordings)

    def residuals(values: dict[str, float]) -> np.ndarray:
        """Returns residuals (recordings, k) [m] of free markers."""
        properties = dataclasses.replace(ASSUMED, **values)
        solver = CableSolver("identification", spacing, properties)
        found = np.array([_residuals(solver, recording) for recording in recordings])
        shown = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        progress(f"{shown}: {1e3 * np.abs(found).mean():.2f} mm over free markers")
        return found

    assumed = {name: getattr(ASSUMED, name) for name in UNKNOWNS}
    starts = [{**assumed, "bend": share * ASSUMED.bend} for share in STARTS]
    found = fit(UNKNOWNS, starts, residuals, EVALUATIONS)
    properties = dataclasses.replace(ASSUMED, **found.values)
    return Identified(properties, found.intervals, len(recordings), tuple(spacing.tolist()))


def _residuals(solver: CableSolver, recording: Recording) -> np.ndarray:
    """Returns residuals (k,) [m] of free markers in every few frames."""
    off = solver.predict(scenario_of(recording)) - recording.markers[START_FRAMES:]
    return np.delete(off, HELD, axis=1)[::EVERY].ravel()
