"""Recordings of rags for a search: repeat 0 to fit, the others held out.

A rag is assumed taut between its grippers: a pinch holds it within its corners, and with slack a
sheet hangs in one of several shapes, which may depend on the time step.
"""

import dataclasses
import pathlib

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import primitives, rags
from softgym_mj.reality.identification.recordings import (
    FIT,
    HELD_OUT,
    Clouds,
    Motion,
    Recording,
    Scene,
    camera_toward,
    spread,
)
from softgym_mj.reality.identification.tasks import Task
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.rag_scene import TABLE, corners, hung
from softgym_mj.reality.replay import Hold, replay

GAP = primitives.GRIPPER_X[1] - primitives.GRIPPER_X[0]  # [m]
SIZE = (GAP, 0.63)  # [m] Width between the grippers, and height.
SPACING = 0.0263  # [m] 19 x 25 vertices.
FINER = 2.5  # Divisor of a search's spacing and step for its last refinements.
# Not part of the data: the position of the virtual camera in the benchmark's script.
CAMERA = (-0.05, 1.774, 0.808)  # [m]
# [s] End of the frames that are used. Later, a flung rag depends more on the mesh than on the
# fabric: with half the spacing it differs by a centimeter. Five seconds of dragging determine the
# friction.
LAST = {"dynamic": 2.5, "quasi_static": 11.0}
_FRAMES = {"dynamic": 40, "quasi_static": 80}  # Frames that are used of each primitive.
# [s] Durations before the primitive; the latter only if the rag is slack.
_SETTLE, _TOGETHER = 1.0, 1.0
_GRID = 0.01  # [s] Time step of stored motions.
_AFTER = 0.1  # [s] Simulated after the last frame: clocks may be early.


class RagScene(Scene):
    """Rag that is moved by a primitive."""

    def __init__(
        self,
        primitive: str,
        end: float,
        size: tuple[float, float] = SIZE,
        spacing: float = SPACING,
        table: float = TABLE,
        step: float = solver.TIMESTEP,
    ):
        """Sets up a rag of a size [m] (between the grippers, down), simulated until `end` [s]."""
        self.mesh = rectangle(*size, spacing)
        self._size, self._spacing, self._step = size, spacing, step
        self._primitive, self._end, self._table = primitive, end, table
        self._slack = size[0] - GAP

    def finer(self, by: float) -> "RagScene":
        """Returns the scene with spacing and step divided."""
        return RagScene(
            self._primitive, self._end, self._size, self._spacing / by, self._table, self._step / by
        )

    def motion(self, fabric):
        is_slack = abs(self._slack) > 1e-6
        begin = -_SETTLE - (2.0 * _TOGETHER if is_slack else 0.0)

        def path(times: np.ndarray) -> np.ndarray:
            positions = primitives.gripper_positions(self._primitive, times)
            apart = np.interp(times, [-2.0 * _TOGETHER, -_TOGETHER], [self._slack / 2.0, 0.0])
            positions[:, 0, 0] -= apart
            positions[:, 1, 0] += apart
            return positions

        times = np.arange(round(self._end / _GRID) + 1) * _GRID
        found = replay(
            self.mesh, fabric, [Hold(corners(self.mesh), path)], times, start=hung(self.mesh),
            begin=begin, floor=self._table, step=self._step, by_area=True, watched=False,
        )  # fmt: skip
        return Motion(times, found.positions)


def read_task(folder: pathlib.Path, cloth: str, base: Fabric, **settings) -> Task:
    """Returns the task of a search, with a finer mesh for its last refinements.

    Args:
        folder, cloth: as in `read_rags`.
        base: as in `Task`.
        **settings: other arguments of `read_rags`.

    Raises:
        StoreError: as in `read_rags`.
    """
    scenes, recordings = read_rags(folder, cloth, **settings)
    finer = {name: scene.finer(FINER) for name, scene in scenes.items()}
    looked = []
    for recording in recordings:
        assert isinstance(recording.observation, Clouds)
        clouds = recording.observation.of(finer[recording.scene].mesh)
        looked.append(dataclasses.replace(recording, observation=clouds))
    return Task(scenes, tuple(recordings), base, Task(finer, tuple(looked), base))


def read_rags(
    folder: pathlib.Path,
    cloth: str,
    size: tuple[float, float] = SIZE,
    spacing: float = SPACING,
    table: float = TABLE,
    camera: tuple[float, float, float] | None = None,
) -> tuple[dict[str, RagScene], list[Recording]]:
    """Returns scenes by name, and all recordings of a cloth, with frames until `LAST`.

    Args:
        folder: folder of the unpacked archive.
        cloth: name in `rags.CLOTHS`.
        size: size of the rag between the grippers, and down [m].
        spacing: spacing of the mesh's vertices [m].
        table: height of the table [m].
        camera: position of the camera [m]; None if unknown.

    Raises:
        StoreError: if repeat 0 is missing, or files are damaged.
    """
    scenes: dict[str, RagScene] = {}
    found = []
    for repeat in rags.REPEATS:
        for primitive in rags.FRAMES:
            if not rags.sequence_folder(folder, cloth, repeat, primitive).is_dir():
                continue
            most = int(LAST[primitive] * rags.FRAME_RATE) + 1
            frames = min(rags.counted_frames(cloth, repeat, primitive), most)
            clouds = rags.read_sequence(folder, cloth, repeat, primitive)
            chosen = spread(frames, _FRAMES[primitive])
            points = [clouds[i].points for i in chosen]
            end = (frames - 1) / rags.FRAME_RATE + _AFTER
            scene = scenes.setdefault(primitive, RagScene(primitive, end, size, spacing, table))
            seen_from = None if camera is None else camera_toward(camera, points)
            found.append(
                Recording(
                    f"{cloth}_{repeat}/{primitive}",
                    FIT if repeat == 0 else HELD_OUT,
                    primitive,
                    chosen / rags.FRAME_RATE,
                    Clouds(points, scene.mesh, seen_from),
                )
            )
    if not any(recording.role == FIT for recording in found):
        lacking = rags.sequence_folder(folder, cloth, 0, "dynamic")
        raise StoreError(f"{lacking}: repeat 0 is missing, and so is quasi_static")
    return scenes, found
