"""Properties of a cloth from recordings, by least squares, with 95 % intervals.

Only the ratios of stiffness, drag and the air's mass to the cloth's show in motion: the density is
assumed. Stretch is too small to be seen.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from softgym_mj.exceptions import check_count
from softgym_mj.reality.cloth.recordings import Recording
from softgym_mj.reality.cloth.scenario import grip_of, scenario_of
from softgym_mj.reality.cloth.simulation import ASSUMED, ClothSolver, Properties
from softgym_mj.reality.fitting import FEWEST, Identified, Unknown, fit

UNKNOWNS = {
    "bend": Unknown(1e-6, 1e-3, 0.1),
    "bend_damping": Unknown(1e-3, 1.0, 0.1),
    "drag": Unknown(0.1, 10.0, 0.1),
    "added_mass": Unknown(1e-3, 1.0, 0.1),
    "length": Unknown(0.9, 1.1, 0.005),
}
STARTS = (1.0, 0.3)  # The air's mass relative to the assumed one, of which the best is taken.
EVALUATIONS = 6  # Steps of the search.


def identify(
    recordings: Sequence[Recording], progress: Callable[[str], None] = lambda line: None
) -> Identified[Properties]:
    """Identifies the unknowns from recordings of one session.

    Args:
        recordings: Recordings, 5 or more.
        progress: Receives a line for each evaluation.

    Raises:
        InvalidArgumentError: For less recordings.
    """
    check_count("recordings", len(recordings), FEWEST)
    grip = grip_of(recordings)
    cases = [scenario_of(recording, grip) for recording in recordings]
    longest = max(nodes.size for _, nodes in cases)

    def residuals(values: dict[str, float]) -> np.ndarray:
        """Returns residuals (recordings, k) [m] of nodes, 0 after a recording's last."""
        solver = ClothSolver("identification", grip, dataclasses.replace(ASSUMED, **values))
        found = np.zeros((len(cases), longest))
        for row, (scenario, nodes) in zip(found, cases, strict=True):
            row[: nodes.size] = (solver.predict(scenario) - nodes).ravel()
        shown = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        seen = sum(nodes.size for _, nodes in cases)
        progress(f"{shown}: {1e3 * np.abs(found).sum() / seen:.2f} mm per coordinate")
        return found

    assumed = {name: getattr(ASSUMED, name) for name in UNKNOWNS}
    starts = [{**assumed, "added_mass": share * ASSUMED.added_mass} for share in STARTS]
    found = fit(UNKNOWNS, starts, residuals, EVALUATIONS)
    properties = dataclasses.replace(ASSUMED, **found.values)
    return Identified(properties, found.intervals, len(recordings))
