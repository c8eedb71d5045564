"""`BareSheet`: a sheet in air, which is simulated and not rendered."""

import mujoco
import numpy as np

from softgym_mj.entities.cloth import alternating_triangles
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.mesh_files import triangle_areas
from softgym_mj.entities.sheet import Sheet
from softgym_mj.reality.alone import compiled_alone, set_masses


class BareSheet(Sheet):
    """A sheet of any mesh without a skin."""

    def _build(self, points: np.ndarray, triangles: np.ndarray, fabric: Fabric):
        """Builds the sheet.

        Args:
            points: Vertices (n, 3) [m] at rest.
            triangles: Vertex indices (m, 3).
            fabric: The fabric.
        """
        self.vertex_areas = _vertex_areas(points, triangles)
        self._start_sheet("sheet", fabric)
        self._set_mesh(points, triangles)

    def _mass(self, density: float) -> float:
        return density * float(self.vertex_areas.sum())

    def _skin(self, refinement: int) -> None:
        return None


def rectangle(width: float, depth: float, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns vertices (number**2, 3) [m] and triangles (m, 3) of a rectangle in the plane z = 0.

    Rows go along X, from the largest Y to the smallest.
    """
    x, y = np.meshgrid(
        np.linspace(-width / 2, width / 2, number), np.linspace(depth / 2, -depth / 2, number)
    )
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points, alternating_triangles(number, number)


def compiled(
    points: np.ndarray, triangles: np.ndarray, fabric: Fabric
) -> tuple[BareSheet, mujoco.MjModel, mujoco.MjData]:
    """Compiles a sheet alone, whose vertices have the masses of the areas around them.

    By default MuJoCo gives all vertices of a flex the same mass: twice their share at a rim, so
    that a hem is too heavy, the more the coarser the mesh.

    Args:
        points: Vertices (n, 3) [m] at rest.
        triangles: Vertex indices (m, 3).
        fabric: The fabric.
    """
    sheet = BareSheet(points, triangles, fabric)
    model, data = compiled_alone(sheet)
    set_masses(sheet, model, data, fabric.density * sheet.vertex_areas)
    return sheet, model, data


def _vertex_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Returns areas (n,) [m^2] of vertices: a third of the triangles around each."""
    shares = np.repeat(triangle_areas(points, triangles) / 3.0, 3)
    return np.bincount(triangles.ravel(), shares, len(points))
