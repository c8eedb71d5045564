"""Captures of a garment for a search: two of three of an action to fit, the third to be held out.

Latency is what comes to the delay that the benchmark says of each capture.
"""

import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import garment_scene, garments
from softgym_mj.reality.garment_windows import SHOULDERS, WINDOWS, Window
from softgym_mj.reality.identification.recordings import (
    FIT,
    HELD_OUT,
    Clouds,
    Motion,
    Recording,
    Scene,
    looking,
    spread,
)
from softgym_mj.reality.meshes import Mesh
from softgym_mj.reality.replay import Path
from softgym_mj.reality.validation.garment_cases import check, mesh_file

THIRD = 3  # Of so many captures of an action the last one is held out.
_GRID = 0.01  # [s] Of what is kept of a motion.


class GarmentScene(Scene):
    """A garment with two vertices that follow the end effectors of a capture."""

    def __init__(
        self,
        mesh: Mesh,
        action: str,
        paths: Mapping[str, Path],
        window: Window,
        held: tuple[int, ...] | None,
        place: tuple[float, float],
    ):
        """Of what `garment_scene.replay_garment` takes."""
        self.mesh = mesh
        self._action, self._paths, self._window = action, paths, window
        self._held, self._place = held, place

    def motion(self, fabric: Fabric) -> Motion:
        begin, end = self._window.begin, self._window.end
        times = begin + np.arange(round((end - begin) / _GRID) + 1) * _GRID
        done, _ = garment_scene.replay_garment(
            self.mesh, fabric, self._action, self._paths, times,
            begin=begin, held=self._held, place=self._place,
        )  # fmt: skip
        return Motion(times, done.positions)


def read_garments(
    folder: pathlib.Path,
    garment: str,
    actions: Sequence[str] = garments.ACTIONS,
    *,
    mesh: pathlib.Path | None = None,
    held: tuple[int, ...] | None = None,
    window: Window | None = None,
    swapped: bool = False,
    place: tuple[float, float] = garment_scene.PLACE,
) -> tuple[dict[str, Scene], list[Recording]]:
    """Scenes by name, and all captures of a garment below a folder.

    Args:
        folder: of the data set.
        garment: of `garments.GARMENTS`.
        actions: which of `garments.ACTIONS`.
        mesh: an OBJ; None for the benchmark's.
        held: vertices by the order of the OBJ that arms hold; None for the benchmark's.
        window: of what counts, in all captures; None for the benchmark's.
        swapped: whether the left arm's base is at Y = -0.25 m instead of 0.25 m.
        place: of the origin of the mesh, X and Y [m].

    Raises:
        StoreError: with the name of the file, if anything is missing or damaged.
    """
    scenes: dict[str, Scene] = {}
    found: list[Recording] = []
    file = mesh or mesh_file(folder, garment)
    shape = garment_scene.garment_mesh(file)
    bases = {arm: -y if swapped else y for arm, y in garment_scene.BASES.items()}
    counted: dict[str, int] = {}
    for path in check(folder, [garment], actions).captures:
        capture = garments.read_capture(path)
        counts = window or WINDOWS.get(path.name)
        if counts is None:
            raise StoreError(f"{path}: not in the benchmark's list; say which seconds count")
        times = capture.simulated_times(counts.delay)
        inside = np.flatnonzero((times >= counts.begin) & (times <= counts.end))
        if len(inside) == 0:
            raise StoreError(f"{path}: no cloud from {counts.begin} to {counts.end} s")
        pins = held or (SHOULDERS.get(garment) if capture.action == "fling" else None)
        vertices = garment_scene.vertices_of_file(file, shape, pins) if pins else None
        paths = {arm: _Recorded(capture, arm, bases) for arm in garments.ARMS}
        scenes[path.name] = GarmentScene(shape, capture.action, paths, counts, vertices, place)
        chosen = inside[spread(len(inside))]
        clouds = capture.world_clouds()
        points = [clouds[i] for i in chosen]
        eye = np.linalg.inv(capture.camera)[:3, 3]
        number = counted[capture.action] = counted.get(capture.action, 0) + 1
        seen = Clouds(points, shape, looking((eye[0], eye[1], eye[2]), points))
        role = HELD_OUT if number % THIRD == 0 else FIT
        found.append(Recording(path.name, role, path.name, times[chosen], seen))
    return scenes, found


class _Recorded:
    """The path of an end effector, as other processes can be sent it."""

    def __init__(self, capture: garments.Capture, arm: str, bases: Mapping[str, float]):
        path = garment_scene.ends(capture, bases)[arm]
        self._times = capture.arms[arm].times - capture.first_stamp
        self._places = path(self._times)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        columns = self._places.reshape(len(self._times), 3).T
        return np.stack([np.interp(times, self._times, x) for x in columns], axis=1)[:, None]
