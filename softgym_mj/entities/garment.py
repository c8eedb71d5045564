"""`Garment`: a sheet of any shape, read from a mesh file."""

import os
import pathlib
import warnings

import numpy as np
from scipy import sparse

from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.flex import Color
from softgym_mj.entities.mesh_files import mesh_warnings, read_mesh, triangle_areas
from softgym_mj.entities.sheet import BACK_COLOR, FRONT_COLOR, Sheet
from softgym_mj.rendering.skins import refined
from softgym_mj.validation import typed

HEMMED = 0.05  # Share of the weave's texture at its sides that shows a hem and is cut off.

# Meshes with more vertices are not refined for rendering: they are fine enough.
MOST_REFINED = 2000
# [bytes] Memory for MuJoCo's collision detection: twice what the pairs of bodies require.
_LEAST_MEMORY, _MEMORY_OF_PAIR = 2**24, 4


class MeshSheet(Sheet):
    """Sheet of any shape, drawn in two colors: the base of `Garment` and `Shirt`.

    Attributes:
        area: area of all triangles [m^2].
    """

    def _set_shape(self, points: np.ndarray, triangles: np.ndarray) -> None:
        """Replaces the mesh by `points` (n, 3) [m] and `triangles` (m, 3)."""
        memory = _LEAST_MEMORY + _MEMORY_OF_PAIR * len(points) ** 2
        self._mjcf_root.size.memory = str(memory)
        self.area = float(triangle_areas(points, triangles).sum())
        self._set_mesh(points, triangles)

    def laid(self, center: tuple[float, float] = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
        """Returns vertex positions (num_points, 3) [m] in the rest shape, on the floor.

        Args:
            center: (X, Y) [m] of the middle of its bounding box before rotation.
            angle: rotation about +Z [rad].
        """
        low, high = self._rest_points.min(axis=0), self._rest_points.max(axis=0)
        upright = self._rest_points - [*(low + high)[:2] / 2, low[2]]
        return self._turned(upright, center, angle)

    def _mass(self, density: float) -> float:
        return density * self.area

    def _skin(self, refinement: int) -> tuple[sparse.csr_array, np.ndarray, np.ndarray]:
        weights, faces = sparse.eye_array(self.num_points, format="csr"), self.triangles
        steps = refinement.bit_length() - 1 if self.num_points <= MOST_REFINED else 0
        for _ in range(steps):
            finer, faces = refined(weights.shape[0], faces)
            weights = finer @ weights
        low, high = self._rest_points.min(axis=0), self._rest_points.max(axis=0)
        flat = (weights @ self._rest_points - low)[:, :2] / max((high - low)[:2])
        return weights, faces, HEMMED + (1.0 - 2.0 * HEMMED) * flat


class Garment(MeshSheet):
    """Sheet with the vertices and triangles of a mesh file, drawn in two colors.

    No edge is stretched in the shape of the file; bending forces flatten it. The mesh is repaired
    as in `read_mesh`. Slim triangles, edges of any length, holes, and unconnected parts are
    allowed; a warning names those that limit the simulation. Self-intersections of the file stay
    entangled: `intersections()` counts them.
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
            file: an OBJ, OFF, PLY or STL file of up to 5000 vertices, as in `read_mesh`. Layers on
                top of each other must be one thickness apart, except where they are sewn together.
            scale: meters per unit of the file: 0.001 for millimeters.
            fabric: fabric; None for a woven tablecloth. Layers rest closer at triangles lower than
                1.1 times its thickness, and folds are coarse at edges longer than 6 times.
            colors: (r, g, b, a) in 0..1 of the side with counter-clockwise triangles, and of the
                other.
            name: model name.

        Raises:
            InvalidArgumentError: as in `read_mesh`.
        """
        points, triangles = read_mesh(file, scale)
        self._start_sheet(name, fabric, colors)
        defects = mesh_warnings(points, triangles, self._values["thickness"])
        if defects:
            warnings.warn(f"{pathlib.Path(file).name}: {'; '.join(defects)}", stacklevel=2)
        self._set_shape(points, triangles)
