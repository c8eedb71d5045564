"""A task of identification, and how far off parameters are: what searches call, in any process."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality.identification.recordings import FIT, Motion, Recording, Scene
from softgym_mj.reality.identification.unknowns import LATENCY, fabric_of, values_at

# Where a clock may be off: a data set has a delay of 0.474 s beside one of 0.047 s.
_SLIPS = np.arange(-0.6, 0.6001, 0.02)  # [s]
_FEW = 12  # Frames of a recording for a coarse look at all of these.
_FINER = (0.01, 0.005, 0.0025, 0.00125, 0.000625)  # [s]


@dataclasses.dataclass(frozen=True)
class Task:
    """Recordings of a fabric.

    Attributes:
        scenes: what is simulated, by name.
        recordings: of these; at least one is to fit.
        base: a fabric with the density, and all that is not looked for.
        finer: the same with finer meshes, for a last look; None if there is none.
    """

    scenes: Mapping[str, Scene]
    recordings: tuple[Recording, ...]
    base: Fabric
    finer: "Task | None" = None

    @property
    def fitted(self) -> tuple[Recording, ...]:
        """The recordings that are fitted."""
        return tuple(r for r in self.recordings if r.role == FIT)

    def only_fitted(self) -> "Task":
        """The task without what is held out."""
        used = {recording.scene for recording in self.fitted}
        scenes = {name: scene for name, scene in self.scenes.items() if name in used}
        finer = self.finer and self.finer.only_fitted()
        return Task(scenes, self.fitted, self.base, finer)


def motions(task: Task, fabric: Fabric) -> dict[str, Motion]:
    """What a fabric does in each scene."""
    return {name: scene.motion(fabric) for name, scene in task.scenes.items()}


def evaluate(
    task: Task, coordinates: tuple[float, ...], is_finer: bool = False
) -> list[list[float]]:
    """Offsets [m] of each frame of all recordings, in their order, at coordinates of all unknowns.

    Of the task, or of the finer one. To a tenth of a micrometre: journals keep them.
    """
    if is_finer:
        assert task.finer is not None
        return evaluate(task.finer, coordinates)
    values = values_at(coordinates)
    moved = motions(task, fabric_of(values, task.base))
    return [
        frame.ravel().round(7).tolist()
        for recording in task.recordings
        for frame in recording.offsets(moved[recording.scene], values[LATENCY])
    ]


def slip(recordings: Sequence[Recording], motions: Sequence[Motion]) -> float:
    """The latency [s] at which recordings fit their motions best, within 0.6 s of none."""

    def far(latency: float, few: int | None = None) -> float:
        return sum(
            float(r.distances(motion, latency, _every(r, few)).mean())
            for r, motion in zip(recordings, motions, strict=True)
        )

    best = float(min(_SLIPS, key=lambda latency: far(latency, _FEW)))
    for step in _FINER:
        best = min((best - step, best, best + step), key=far)
    return best


def _every(recording: Recording, few: int | None) -> slice:
    """Some frames of a recording, spread over it, or all."""
    return slice(None, None, 1 if few is None else max(len(recording.times) // few, 1))
