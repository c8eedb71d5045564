"""Identification tasks and their residuals; searches call these functions in any process."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality.identification.recordings import FIT, Motion, Recording, Scene
from softgym_mj.reality.identification.unknowns import LATENCY, fabric_of, values_at

# [s] Latencies that are tried: one data set has a delay of 0.474 s in one sequence and 0.047 s in
# another.
_LATENCIES = np.arange(-0.6, 0.6001, 0.02)
_FEW = 12  # Frames of a recording for the coarse scan of these.
_FINER = (0.01, 0.005, 0.0025, 0.00125, 0.000625)  # [s] Steps of the refinement.


@dataclasses.dataclass(frozen=True)
class Task:
    """Recordings of a fabric to identify.

    Attributes:
        scenes: simulated scenes by name.
        recordings: recordings of these scenes; at least one is to fit.
        base: fabric that gives the density and everything that is not searched for.
        finer: the same task with finer meshes, for the last evaluations; None if there is none.
    """

    scenes: Mapping[str, Scene]
    recordings: tuple[Recording, ...]
    base: Fabric
    finer: "Task | None" = None

    @property
    def fitted(self) -> tuple[Recording, ...]:
        """Recordings that are fitted."""
        return tuple(r for r in self.recordings if r.role == FIT)

    def only_fitted(self) -> "Task":
        """Returns the task without held-out recordings."""
        used = {recording.scene for recording in self.fitted}
        scenes = {name: scene for name, scene in self.scenes.items() if name in used}
        finer = self.finer and self.finer.only_fitted()
        return Task(scenes, self.fitted, self.base, finer)


def motions(task: Task, fabric: Fabric) -> dict[str, Motion]:
    """Returns the motion of a fabric in each scene."""
    return {name: scene.motion(fabric) for name, scene in task.scenes.items()}


def evaluate(
    task: Task, coordinates: tuple[float, ...], is_finer: bool = False
) -> list[list[float]]:
    """Returns the residuals [m] of each frame of all recordings at coordinates of all unknowns.

    They are rounded to 0.1 micrometers, as journals store them.

    Args:
        task: recordings.
        coordinates: (unknowns,).
        is_finer: whether `task.finer` is evaluated instead.
    """
    if is_finer:
        assert task.finer is not None
        return evaluate(task.finer, coordinates)
    values = values_at(coordinates)
    moved = motions(task, fabric_of(values, task.base))
    return [
        frame.ravel().round(7).tolist()
        for recording in task.recordings
        for frame in recording.residuals(moved[recording.scene], values[LATENCY])
    ]


def best_latency(recordings: Sequence[Recording], motions: Sequence[Motion]) -> float:
    """Returns the latency [s], within 0.6 s of none, at which recordings fit their motions best."""

    def far(latency: float, few: int | None = None) -> float:
        return sum(
            float(r.distances(motion, latency, _every(r, few)).mean())
            for r, motion in zip(recordings, motions, strict=True)
        )

    best = float(min(_LATENCIES, key=lambda latency: far(latency, _FEW)))
    for step in _FINER:
        best = min((best - step, best, best + step), key=far)
    return best


def _every(recording: Recording, few: int | None) -> slice:
    """Returns evenly spread frames of a recording, or all."""
    return slice(None, None, 1 if few is None else max(len(recording.times) // few, 1))
