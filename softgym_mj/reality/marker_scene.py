"""Recordings of markers as a scene: a sheet whose corner markers go where they were recorded.

Markers are taken to be on a grid of the sheet, numbered row by row, one way or the other. How far
apart they are at rest is read off the recording: a cloth hardly stretches, so that it is what their
distances reach and hardly exceed. Cloth beyond the outermost markers is left out.
"""

import dataclasses

import numpy as np
from scipy.interpolate import RectBivariateSpline

from softgym_mj.cloth import solver
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.markers import Markers
from softgym_mj.reality.meshes import Mesh, grid
from softgym_mj.reality.recorder import Replay
from softgym_mj.reality.replay import Hold, recorded_path, replay

SHAPES = {20: ((4, 5), (5, 4)), 12: ((3, 4), (4, 3))}  # (rows, columns) that a number can have.
REST = 95.0  # Percentile of the distances of neighbours that is their distance at rest.
# Markers whose neighbours, at their farthest, differ by more than this factor are in no such order.
UNEVEN = 1.6
SPACING = 0.025  # [m] Of the mesh, at most.
ROOM = 0.05  # By which part of an edge all edges may be longer rather than one more.


@dataclasses.dataclass(frozen=True)
class MarkerScene:
    """A recording and the sheet that replays it.

    Attributes:
        times: (f,) [s].
        positions: (f, n, 3) [m] of the markers.
        shape: (rows, columns) of them.
        mesh: of the sheet; its row 0 is that of the first markers.
        vertices: (n,) which of its vertices the markers are.
        held: numbers of the markers, from 0, that are held.
    """

    times: np.ndarray
    positions: np.ndarray
    shape: tuple[int, int]
    mesh: Mesh
    vertices: np.ndarray
    held: tuple[int, ...]

    @property
    def free(self) -> np.ndarray:
        """Numbers (k,) of the markers, from 0, that are not held."""
        return np.setdiff1d(np.arange(len(self.vertices)), self.held)

    def start(self) -> np.ndarray:
        """Vertices (n, 3) [m] on a smooth surface through the markers of the first frame."""
        rows, columns = self.shape
        first = self.positions[0].reshape(rows, columns, 3)
        places = [np.arange(rows), np.arange(columns)]
        number = len(np.unique(self.mesh.points[:, 1])), len(np.unique(self.mesh.points[:, 0]))
        finer = [np.linspace(0, n - 1, k) for n, k in zip(self.shape, number, strict=True)]
        orders = {"kx": min(3, rows - 1), "ky": min(3, columns - 1)}
        surfaces = [RectBivariateSpline(*places, first[..., i], **orders)(*finer) for i in range(3)]
        return np.stack(surfaces, axis=-1).reshape(-1, 3)

    def replay(
        self, fabric: Fabric, floor: float | None = None, step: float = solver.TIMESTEP
    ) -> Replay:
        """What the sheet does, from rest at the first frame on; at all frames.

        Args:
            fabric: what it is made of.
            floor: height [m] of a plane; None for none.
            step: of the physics [s].
        """
        start = self.start()
        held = list(self.held)
        path = recorded_path(self.times, self.positions[:, held])
        hold = Hold(tuple(int(v) for v in self.vertices[held]), path)
        return replay(
            self.mesh, fabric, [hold], self.times, start=start, begin=float(self.times[0]),
            floor=floor, step=step,
        )  # fmt: skip


def scene(
    markers: Markers,
    *,
    unit: float = 1.0,
    held: tuple[int, ...] | None = None,
    spacing: float = SPACING,
    name: str = "markers",
) -> MarkerScene:
    """The scene of a recording.

    Args:
        markers: 12 or 20 of them.
        unit: metres in a unit of the file.
        held: numbers of the markers, from 0, that are held; None for the two corners of the grid
            that are highest in the first frame.
        spacing: of the mesh [m], at most.
        name: of the recording, for errors.

    Raises:
        InvalidArgumentError: for a unit or markers that make no sense.
        StoreError: if there are other numbers of markers, or they are not numbered row by row.
    """
    if not 0.0 < unit < np.inf:
        raise InvalidArgumentError("unit", unit, "a finite number of metres above 0")
    positions = markers.positions * unit
    number = positions.shape[1]
    if number not in SHAPES:
        raise StoreError(f"{name}: {number} markers; expected {' or '.join(map(str, SHAPES))}")
    found = {shape: _rest(positions, shape) for shape in SHAPES[number]}
    uneven = {shape: max(d.max() / d.min() for d in rest) for shape, rest in found.items()}
    shape = min(uneven, key=uneven.__getitem__)
    if uneven[shape] > UNEVEN:
        raise StoreError(
            f"{name}: markers are not numbered row by row in a grid of {list(found)}: distances "
            f"of neighbours differ by a factor of {uneven[shape]:.1f}"
        )
    down, across = (float(np.mean(distances)) for distances in found[shape])
    rows, columns = shape
    finer = [max(int(np.ceil(length / spacing - ROOM)), 1) for length in (down, across)]
    vertices = [(n - 1) * k + 1 for n, k in zip(shape, finer, strict=True)]
    mesh = grid((columns - 1) * across, (rows - 1) * down, *vertices)
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    places = (i * finer[0] * vertices[1] + j * finer[1]).ravel()
    if held is None:
        corners = np.array([0, columns - 1, number - columns, number - 1])
        highest = np.argsort(-positions[0, corners, 2], kind="stable")[:2]
        held = tuple(sorted(int(corner) for corner in corners[highest]))
    if not held or not all(0 <= marker < number for marker in held):
        raise InvalidArgumentError(
            "held", held, f"numbers of {number} markers, from 0, one or more"
        )
    return MarkerScene(markers.times, positions, shape, mesh, places, held)


def _rest(positions: np.ndarray, shape: tuple[int, int]) -> list[np.ndarray]:
    """Distances at rest [m] of neighbours: one below the other, and beside each other."""
    grids = positions.reshape(len(positions), *shape, 3)
    return [
        np.percentile(np.linalg.norm(np.diff(grids, axis=axis), axis=3), REST, axis=0).ravel()
        for axis in (1, 2)
    ]
