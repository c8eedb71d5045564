"""`Garment`: a sheet of any shape, read from a mesh file."""

import os
import pathlib
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from softgym_mj.entities.flex import Color
from softgym_mj.entities.sheet import BACK_COLOR, FRONT_COLOR, Fabric, Sheet
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.kinds import typed
from softgym_mj.native.arithmetic import product
from softgym_mj.rendering.skins import refined

# Accepted lengths of edges in thicknesses. Below, layers would be thinner than they are drawn;
# above, folds are coarse. Cloths have 2 to 4.
SHORTEST_EDGE, LONGEST_EDGE = 1.5, 6.0
# Least height of a triangle over its longest edge: slimmer ones are as stiff as wire.
LEAST_HEIGHT = 0.1

HEMMED = 0.05  # Part of the weave's picture at its sides that has a hem: it is cut off.

# Compiled only to be read. Without edge constraints MuJoCo would warn of a flex without forces.
_READER = """<mujoco><worldbody>
<flexcomp name="mesh" type="mesh" dim="2" file={file} scale="{scale} {scale} {scale}" mass="1">
<edge equality="true"/></flexcomp></worldbody></mujoco>"""


@typed
def read_mesh(file: str | os.PathLike, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (n, 3) [m] and triangles (m, 3) of a mesh file, as MuJoCo reads it.

    MuJoCo reads OBJ, STL and MSH files; of an OBJ the first object only. It splits polygons into
    triangles, joins vertices at the same place and leaves out those that no triangle has.

    Args:
        file: the mesh.
        scale: metres in a unit of the file.

    Raises:
        InvalidArgumentError: if there is no such file or it has no triangles; for a bad scale.
    """
    if scale <= 0.0:
        raise InvalidArgumentError("scale", scale, "above 0")
    path = pathlib.Path(file).resolve()
    if not path.is_file():
        raise InvalidArgumentError(
            f"file={str(file)!r} does not exist; expected an OBJ, STL or MSH file."
        )
    try:
        xml = _READER.format(file=quoteattr(str(path)), scale=scale)
        model = mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        raise InvalidArgumentError(f"MuJoCo cannot read file={str(file)!r}: {error}") from error
    return model.body_pos[model.flex_vertbodyid], model.flex_elem.reshape(-1, 3).copy()


def check_mesh(points: np.ndarray, triangles: np.ndarray, thickness: float) -> None:
    """Raises `InvalidArgumentError` unless a mesh can be a sheet so thick [m]."""
    sides = points[np.roll(triangles, -1, axis=1)] - points[triangles]
    lengths = np.linalg.norm(sides, axis=2)
    heights = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / lengths.max(axis=1)
    slim = np.flatnonzero(heights < LEAST_HEIGHT * lengths.max(axis=1))
    if len(slim):
        raise InvalidArgumentError(
            f"triangle {slim[0]}, of vertices {triangles[slim[0]].tolist()}, is degenerate: it is "
            f"{heights[slim[0]]:.2g} m high on a side of {lengths[slim[0]].max():.2g} m; expected "
            f"{LEAST_HEIGHT:.0%} of it at least. {len(slim)} of {len(triangles)} are."
        )
    low, high = SHORTEST_EDGE * thickness, LONGEST_EDGE * thickness
    if lengths.min() < low or lengths.max() > high:
        raise InvalidArgumentError(
            f"edges are {lengths.min():.3g} to {lengths.max():.3g} m long; with "
            f"thickness={thickness} m expected {low:.3g} to {high:.3g} m: change the scale, the "
            "fabric or the mesh."
        )
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2))
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    if counts.max() > 2:
        raise InvalidArgumentError(
            f"the edge of vertices {edges[counts.argmax()].tolist()} belongs to {counts.max()} "
            "triangles; expected 1 or 2."
        )


class Garment(Sheet):
    """A sheet with the vertices and triangles of a mesh file, drawn in two colours.

    The shape in the file is the one in which no edge is stretched; bending forces flatten it. Parts
    that are not connected are allowed.

    Attributes:
        area: of all its triangles [m^2].
    """

    @typed
    def _build(
        self,
        file: str | os.PathLike,
        *,
        scale: float = 1.0,
        fabric: Fabric | None = None,
        colors: tuple[Color, Color] = (FRONT_COLOR, BACK_COLOR),
        name: str = "garment",
    ):
        """Builds the garment.

        Args:
            file: an OBJ, STL or MSH file, as in `read_mesh`. Layers that lie upon each other have
                to be its thickness apart, but where they are sewn together.
            scale: metres in a unit of the file.
            fabric: what it is made of; None for a woven tablecloth. Edges have to be 1.5 to 6 times
                as long as it is thick.
            colors: (r, g, b, a) in 0..1 of the side on which triangles are counter-clockwise, and
                of the other side.
            name: model name.

        Raises:
            InvalidArgumentError: if the file is missing, no mesh, or none that can be a sheet; for
                a bad scale.
        """
        points, triangles = read_mesh(file, scale)
        self._start_sheet(name, fabric, colors)
        check_mesh(points, triangles, self._values["thickness"])
        corners = points[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.area = float(np.linalg.norm(normals, axis=1).sum() / 2)
        self._set_mesh(points, triangles)

    def laid(self, centre: tuple[float, float] = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
        """Vertex positions (num_points, 3) [m] in the shape of the file, on the floor.

        Args:
            centre: (X, Y) [m] of the middle of its bounding box before it is turned.
            angle: rotation about +Z [rad].
        """
        low, high = self._rest_points.min(axis=0), self._rest_points.max(axis=0)
        upright = self._rest_points - [*(low + high)[:2] / 2, low[2]]
        return self._turned(upright, centre, angle)

    def _mass(self, density: float) -> float:
        return density * self.area

    def _skin(self, refinement: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        weights, faces = np.eye(self.num_points), self.triangles
        for _ in range(refinement.bit_length() - 1):
            finer, faces = refined(len(weights), faces)
            weights = product(finer, weights)
        low, high = self._rest_points.min(axis=0), self._rest_points.max(axis=0)
        flat = (product(weights, self._rest_points) - low)[:, :2] / max((high - low)[:2])
        return weights, faces, HEMMED + (1.0 - 2.0 * HEMMED) * flat
