"""Errors of solvers on recordings, which they predict without seeing them."""

import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from softgym_mj.exceptions import SimulationError
from softgym_mj.reality.rope.recordings import FRAME_TIME, HELD, Recording
from softgym_mj.reality.rope.scenario import START_FRAMES, Scenario, scenario_of
from softgym_mj.reality.solver import Solver


@dataclasses.dataclass(frozen=True)
class Measurement:
    """Mean errors of a solver over the recordings of a cable.

    Attributes:
        cable: Name of the cable.
        solver: Name of the solver.
        models: Effects that the solver models.
        recordings: Number of recordings.
        error: Mean absolute error [m] per coordinate, over all frames and markers. Held markers
            count, although their paths are given: the authors of the recordings compute it so.
        free_error: The same over markers that are not held.
        worst: Largest `error` of a recording [m].
        real_time_factor: Simulated over CPU time.
    """

    cable: str
    solver: str
    models: tuple[str, ...]
    recordings: int
    error: float
    free_error: float
    worst: float
    real_time_factor: float


def errors(predicted: np.ndarray, markers: np.ndarray) -> tuple[float, float]:
    """Returns the mean absolute error [m] per coordinate over all and over free markers.

    Args:
        predicted, markers: (f, n, 3) [m].
    """
    off = np.abs(predicted - markers)
    return float(off.mean()), float(np.delete(off, HELD, axis=1).mean())


def measure(solver: Solver[Scenario], recordings: Sequence[Recording]) -> Measurement:
    """Predicts recordings of one cable and compares.

    Raises:
        SimulationError: If positions are not finite.
    """
    found, took, frames = [], 0.0, 0
    for recording in recordings:
        scenario = scenario_of(recording)
        before = time.thread_time()
        predicted = solver.predict(scenario)
        took += time.thread_time() - before
        frames += len(predicted)
        if not np.isfinite(predicted).all():
            raise SimulationError(f"{solver.name}, {recording.cable} {recording.name}: diverged")
        found.append(errors(predicted, recording.markers[START_FRAMES:]))
    every, free = np.mean(found, axis=0)
    return Measurement(
        cable=recordings[0].cable,
        solver=solver.name,
        models=solver.models,
        recordings=len(recordings),
        error=float(every),
        free_error=float(free),
        worst=max(error for error, _ in found),
        real_time_factor=frames * FRAME_TIME / max(took, 1e-9),
    )
