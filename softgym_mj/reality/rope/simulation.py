"""`CableSolver`: predicts recordings with this package's rope."""

from collections.abc import Sequence

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.reality.rope.cable import Properties, compiled
from softgym_mj.reality.rope.recordings import FRAME_TIME, HELD, Recording
from softgym_mj.reality.rope.scenario import Scenario
from softgym_mj.reality.solver import step

# One guess for all cables: PVC of 7 mm and 20 MPa; its drag in air at 1.5 m/s.
ASSUMED = Properties(
    density=0.04,
    stretch=800.0,
    bend=2.4e-3,
    stretch_damping=5e-4,
    bend_damping=0.03,
    air_damping=0.0075,
    radius=0.0035,
)
SEGMENT = 0.033  # [m] Approximate vertex spacing.
_EVERY = 50  # Frames between those in which spacing is measured.
_PIECES = 10  # Chords that an arc between markers is measured by.


class CableSolver:
    """Our rope; vertices at held markers follow their paths.

    Attributes:
        name, models: See `Solver`.
    """

    # Neither twist nor a rest shape that is not straight.
    models: tuple[str, ...] = ("stretch", "bending", "damping", "air", "self-contact")

    def __init__(self, name: str, spacing: np.ndarray, properties: Properties):
        """Compiles the model.

        Args:
            name: Name in tables.
            spacing: Measured lengths (n - 1,) [m] of the cable between n markers.
            properties: Properties; their `length` scales spacing between free markers.
        """
        self.name = name
        lengths = np.array(spacing, float)
        lengths[1:-1] *= properties.length
        pieces = np.maximum(np.round(lengths / SEGMENT).astype(int), 1)
        self._at = np.concatenate([[0.0], np.cumsum(lengths)])
        self._markers = np.concatenate([[0], np.cumsum(pieces)])
        segments = np.repeat(lengths / pieces, pieces)
        self._along = np.concatenate([[0.0], np.cumsum(segments)])
        self._cable, self._model, self._data = compiled(segments, properties)
        self._held = self._markers[list(HELD)]
        for vertex in self._held:
            self._cable.hold(int(vertex))

    def predict(self, scenario: Scenario) -> np.ndarray:
        """Returns markers (f, n, 3) [m] in the frames after the start.

        Raises:
            InvalidArgumentError: For another number of markers than the solver's.
            SimulationError: If the simulation diverges.
        """
        first, last = scenario.start
        if len(last) != len(self._at):
            raise InvalidArgumentError(
                "number of markers in scenario", len(last), f"{len(self._at)}"
            )
        mujoco.mj_resetData(self._model, self._data)
        positions = CubicSpline(self._at, last)(self._along)
        velocities = CubicSpline(self._at, (last - first) / FRAME_TIME)(self._along)
        self._cable.set_points(positions, velocities)
        mujoco.mj_forward(self._model, self._data)
        predicted = np.empty((len(scenario.held), len(last), 3))
        for frame, targets in enumerate(scenario.held):
            for vertex, target in zip(self._held, targets, strict=True):
                self._cable.drive(vertex, target, FRAME_TIME)
            if not step(self._model, self._data):
                raise SimulationError(f"{self.name}: diverged at {frame * FRAME_TIME:.2f} s")
            predicted[frame] = self._cable.points()[self._markers]
        return predicted


def marker_spacing(recordings: Sequence[Recording]) -> np.ndarray:
    """Returns mean lengths (n - 1,) [m] of the cable between n markers, of splines through them."""
    frames = [frame for recording in recordings for frame in recording.markers[::_EVERY]]
    return np.mean([_arcs(frame) for frame in frames], axis=0)


def _arcs(markers: np.ndarray) -> np.ndarray:
    """Returns lengths (n - 1,) [m] between markers (n, 3) [m] along a spline."""
    lengths = np.linalg.norm(np.diff(markers, axis=0), axis=1)
    for _ in range(2):  # A spline needs arc lengths: those of the chords, then its own.
        at = np.concatenate([[0.0], np.cumsum(lengths)])
        share = np.linspace(0.0, 1.0, _PIECES + 1)
        points = CubicSpline(at, markers)(at[:-1, None] + np.diff(at)[:, None] * share)
        lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    return lengths
