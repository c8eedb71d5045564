"""`Scene`: the cloth and its motion, the same for every simulator, and measures of positions."""

import dataclasses
import functools
import math
from typing import Any, Protocol

import numpy as np
from scipy import sparse, spatial
from scipy.sparse import csgraph
from trimesh.triangles import closest_point

from softgym_mj.entities.cloth import alternating_triangles
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.intersections import count_intersections

STEP = 0.01  # [s] A timed step, which each simulator divides into its substeps.
# [m] Vertex spacing of the cloth of fold_cloth: 95 by 57 of SoftGym's particles in 20 by 12 cells.
SPACING = 0.0296875
HOLD, DURATION = 0.5, 2.0  # [s] Both upper corners are held until HOLD.
CLEARANCE = 0.05  # [m] Height of the lower edge above the floor if the cloth hangs vertically.
# [rad] Angles from the vertical at the start, in turn: environments have different contacts.
TILTS = np.radians(10.0 + (7 * np.arange(16) % 16) * 10.0 / 15.0)
NEIGHBOR_RINGS = 2  # Triangles within so many edges of a vertex are no layer above it.


@dataclasses.dataclass(frozen=True)
class Scene:
    """A rectangular cloth that hangs from two corners, then falls and crumples on the floor z = 0.

    Attributes:
        rows, columns: Vertices of the grid; row 0 is the upper edge.
        fabric: Material: that of the tasks, without air.
        spacing: Vertex spacing [m].
    """

    rows: int
    columns: int
    fabric: Fabric = dataclasses.field(default_factory=lambda: Fabric(drag=0.0))
    spacing: float = SPACING

    @property
    def num_points(self) -> int:
        """Number of vertices."""
        return self.rows * self.columns

    @property
    def held(self) -> tuple[int, int]:
        """Vertices held until `HOLD`: the ends of row 0."""
        return 0, self.columns - 1

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.fabric.density * (self.rows - 1) * (self.columns - 1) * self.spacing**2

    @functools.cached_property
    def triangles(self) -> np.ndarray:
        """Vertices (m, 3) of the triangles."""
        return alternating_triangles(self.rows, self.columns)

    @functools.cached_property
    def edges(self) -> np.ndarray:
        """Vertices (k, 2) of the edges."""
        pairs = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return np.unique(pairs, axis=0)

    def points(self, tilt: float = 0.0) -> np.ndarray:
        """Returns positions (n, 3) [m] of the flat cloth, `tilt` [rad] from hanging vertically."""
        row, column = np.divmod(np.arange(self.num_points), self.columns)
        down, across = row * self.spacing, (column - (self.columns - 1) / 2) * self.spacing
        top = CLEARANCE + (self.rows - 1) * self.spacing
        return np.column_stack([down * math.sin(tilt), across, top - down * math.cos(tilt)])

    def starts(self, num_envs: int) -> np.ndarray:
        """Returns initial positions (num_envs, n, 3) [m]."""
        return np.stack([self.points(tilt) for tilt in TILTS])[np.arange(num_envs) % len(TILTS)]

    @functools.cached_property
    def _near(self) -> np.ndarray:
        """Whether a triangle (m) is within `NEIGHBOR_RINGS` of a vertex (n): (n, m)."""
        n, ones = self.num_points, np.ones(len(self.edges))
        graph = sparse.coo_array((ones, self.edges.T), (n, n)).tocsr()
        rings = csgraph.dijkstra(graph, directed=False, unweighted=True, limit=NEIGHBOR_RINGS)
        return np.isfinite(rings)[:, self.triangles].any(axis=2)

    def strains(self, points: np.ndarray) -> np.ndarray:
        """Returns strains (..., k) of the edges at positions (..., n, 3) [m]."""
        first, second = self.edges.T
        rest, now = (
            np.linalg.norm(each[..., first, :] - each[..., second, :], axis=-1)
            for each in (self.points(), points)
        )
        return now / rest - 1.0

    def smallest_gap(self, points: np.ndarray) -> float:
        """Returns the smallest distance [m] of a vertex (n, 3) from a triangle of another layer.

        It is infinite if there is none within the thickness and a half.
        """
        corners, most = points[self.triangles], 1.5 * self.fabric.thickness
        centers = corners.mean(axis=1)
        reach = np.linalg.norm(corners - centers[:, None], axis=2).max() + most
        pairs = spatial.KDTree(points).query_ball_tree(spatial.KDTree(centers), reach)
        vertex = np.repeat(np.arange(len(points)), [len(found) for found in pairs])
        triangle = np.concatenate([np.array(found, int) for found in pairs])
        apart = ~self._near[vertex, triangle]
        own = points[vertex[apart]]
        gaps = np.linalg.norm(own - closest_point(corners[triangle[apart]], own), axis=1)
        return float(gaps[gaps < most].min(initial=math.inf))

    def intersections(self, points: np.ndarray) -> int:
        """Returns the number of edges through triangles of the cloth at positions (n, 3) [m]."""
        return count_intersections(points, self.edges, self.triangles)


class Simulation(Protocol):
    """A simulator with environments of a scene.

    Attributes:
        substeps: Number of substeps of a step of `STEP`.
        settings: Settings by name, for the results.
    """

    substeps: int
    settings: dict[str, Any]

    def step(self) -> None:
        """Starts a step of all environments."""

    def wait(self) -> None:
        """Waits for the end of the steps."""

    def restart(self) -> None:
        """Puts all environments at the start, with held corners and without velocities."""

    def release(self) -> None:
        """Releases the corners."""

    def positions(self, number: int) -> np.ndarray:
        """Returns vertex positions (number, n, 3) [m] of the first environments."""

    def peak_memory(self) -> float | None:
        """Returns the largest memory [GB] allocated on the GPU; None without one."""

    def problems(self) -> list[str]:
        """Returns the limits that the simulator reports as exceeded, such as room for contacts."""
