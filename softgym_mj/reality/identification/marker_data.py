"""Recordings of markers for a search: shaking to fit, all others to be held out."""

import pathlib

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import marker_scene
from softgym_mj.reality.identification.recordings import (
    FIT,
    HELD_OUT,
    MarkerPlaces,
    Motion,
    Recording,
    Scene,
    spread,
)
from softgym_mj.reality.markers import read_markers
from softgym_mj.reality.replay import Hold, recorded_path, replay
from softgym_mj.reality.validation.marker_cases import check

SHAKING = "shake"  # In the name of a file that is to fit.
_GRID = 0.01  # [s] Of what is kept of a motion.
_FRAMES = 80  # Of a recording that are looked at: seconds of fast motion.


class MarkersScene(Scene):
    """A sheet whose held markers go where they were recorded, from rest at the first frame on."""

    def __init__(
        self,
        recorded: marker_scene.MarkerScene,
        floor: float | None = None,
        step: float = solver.TIMESTEP,
    ):
        """Of a recording, over a plane at a height [m] or none."""
        self.mesh = recorded.mesh
        self._recorded, self._floor, self._step = recorded, floor, step

    def motion(self, fabric):
        recorded, held = self._recorded, list(self._recorded.held)
        begin, end = recorded.times[0], recorded.times[-1]
        path = recorded_path(recorded.times, recorded.positions[:, held])
        hold = Hold(tuple(int(vertex) for vertex in recorded.vertices[held]), path)
        times = begin + np.arange(round((end - begin) / _GRID) + 1) * _GRID
        done = replay(
            self.mesh, fabric, [hold], times, start=recorded.start(), begin=float(begin),
            floor=self._floor, step=self._step, by_area=True, watched=False,
        )  # fmt: skip
        return Motion(times, done.positions)


def read_marker_folder(
    folder: pathlib.Path,
    unit: float = 1.0,
    held: tuple[int, ...] | None = None,
    spacing: float = marker_scene.SPACING,
    floor: float | None = None,
    fit: str = SHAKING,
) -> tuple[dict[str, Scene], list[Recording]]:
    """Scenes by name, and all recordings below a folder; markers that are held do not count.

    Args:
        folder: of CSV files.
        unit: metres in a unit of the files.
        held: numbers of the markers, from 0, that are held; None for the two upper corners.
        spacing: of the mesh's vertices [m], at most.
        floor: height of a plane [m]; None for none.
        fit: what the names of files that are fitted have in them; the others are held out.

    Raises:
        StoreError: if there are no files, none to fit, or one is damaged.
    """
    scenes: dict[str, Scene] = {}
    found = []
    for file in check(folder):
        name = file.relative_to(folder).with_suffix("").as_posix()
        recorded = marker_scene.scene(
            read_markers(file), unit=unit, held=held, spacing=spacing, name=str(file)
        )
        scene = scenes[name] = MarkersScene(recorded, floor)
        chosen, free = spread(len(recorded.times), _FRAMES), recorded.free
        weights = np.zeros((len(free), len(scene.mesh.points)))
        weights[np.arange(len(free)), recorded.vertices[free]] = 1.0
        seen = MarkerPlaces(recorded.positions[chosen][:, free], weights)
        role = FIT if fit.lower() in name.lower() else HELD_OUT
        found.append(Recording(name, role, name, recorded.times[chosen], seen))
    if not any(recording.role == FIT for recording in found):
        raise StoreError(f"{folder}: no file has {fit!r} in its name; one is to be fitted")
    return scenes, found
