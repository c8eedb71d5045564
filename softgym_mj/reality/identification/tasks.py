"""A task of identification, and how far off parameters are: what searches call, in any process."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from softgym_mj.entities.sheet import Fabric
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
    """

    scenes: Mapping[str, Scene]
    recordings: tuple[Recording, ...]
    base: Fabric

    @property
    def fitted(self) -> tuple[Recording, ...]:
        """The recordings that are fitted."""
        return tuple(r for r in self.recordings if r.role == FIT)

    def only_fitted(self) -> "Task":
        """The task without what is held out."""
        used = {recording.scene for recording in self.fitted}
        scenes = {name: scene for name, scene in self.scenes.items() if name in used}
        return dataclasses.replace(self, scenes=scenes, recordings=self.fitted)


def motions(task: Task, fabric: Fabric) -> dict[str, Motion]:
    """What a fabric does in each scene."""
    return {name: scene.motion(fabric) for name, scene in task.scenes.items()}


def evaluate(task: Task, coordinates: tuple[float, ...]) -> list[list[float]]:
    """Distances [m] of the frames of each recording at coordinates of all unknowns."""
    values = values_at(coordinates)
    moved = motions(task, fabric_of(values, task.base))
    return [r.distances(moved[r.scene], values[LATENCY]).tolist() for r in task.recordings]


def loss(frames: list[list[float]]) -> float:
    """The mean over recordings of their frames' mean distance [m]."""
    return float(np.mean([np.mean(distances) for distances in frames]))


def slip(recording: Recording, motion: Motion) -> float:
    """The latency [s] at which a recording fits a motion best, within 0.6 s of none."""
    every = max(len(recording.times) // _FEW, 1)
    coarse = slice(None, None, every)

    def far(latency: float, chosen: slice) -> float:
        return float(recording.distances(motion, latency, chosen).mean())

    best = float(min(_SLIPS, key=lambda latency: far(latency, coarse)))
    for step in _FINER:
        near = (best - step, best, best + step)
        best = min(near, key=lambda latency: far(latency, slice(None)))
    return best
