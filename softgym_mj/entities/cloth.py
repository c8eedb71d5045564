"""`Cloth`: a rectangular sheet of woven fabric as a two-dimensional MuJoCo flex."""

import numpy as np
from scipy import sparse

from softgym_mj import metrics
from softgym_mj.entities.fabric import Fabric
from softgym_mj.entities.sheet import Sheet
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.rendering.skins import spline
from softgym_mj.rendering.textures import PAD, STRIP
from softgym_mj.validation import typed

# [m] Spacing of the FleX particles in which SoftGym counts cloth sizes; a side is (dim - 1) of
# them.
PARTICLE_SPACING = 0.00625
MIN_DIM, MAX_DIM = 10, 200  # Accepted sizes in particles: 0.06 m to 1.24 m.
DEFAULT_DIMS = (96, 58)  # SoftGym's size when variations are off (docs/softgym.md 3.0).
# [m] Vertex spacing.
KEY_POINTS = 8  # Number along each side.
FIDELITIES = {"fast": 0.04, "default": 0.03, "accurate": 0.02}


def grid_shape(dims: tuple[int, int], fidelity: str) -> tuple[int, int]:
    """Returns the number of vertex (rows, columns) of a cloth of `dims` = (dimx, dimy) particles.

    They are odd, so that it can be folded in half along edges instead of across cells.
    """
    check_name("fidelity", fidelity, FIDELITIES)
    spacing = FIDELITIES[fidelity]
    columns, rows = (2 * round((dim - 1) * PARTICLE_SPACING / spacing / 2) + 1 for dim in dims)
    return rows, columns


class Cloth(Sheet):
    """Sheet of (rows, columns) vertices; row 0 at +Y, column 0 at -X, front side down.

    This is SoftGym's order (index = row * columns + column, columns along x, rows along z) in z-up
    coordinates; FleX's z is -Y. Triangles of the flat cloth are counter-clockwise from above.

    Attributes:
        dims: size (dimx, dimy) in SoftGym particles.
        shape: number of vertex (rows, columns).
        arrays: arrays that depend on the size, by name. Side lengths `size` (2,) [m], `triangles`
            (m, 3), `corners` (4,) and the `grid` (rows, columns) of vertex indices; weights
            `by_row` (dimy, rows) and `by_column` (dimx, columns) of SoftGym's particles; ones
            `rows` (dimy,) and `columns` (dimx,); the columns of particles of the halves (dimx //
            2,), mirror columns in the same place, and ones, `pairs`, of these.
    """

    @typed
    def _build(
        self,
        size: tuple[float, float] | None = None,
        fidelity: str = "default",
        fabric: Fabric | None = None,
        marker: bool = False,
        name: str = "cloth",
        *,
        dims: tuple[int, int] | None = None,
    ):
        """Builds the cloth.

        Args:
            size: side lengths (along X, along Y) [m], each 0.05625..1.24375, rounded to SoftGym's
                particle spacing of 6.25 mm; None for SoftGym's default, 0.59375 by 0.35625.
            fidelity: "fast", "default" or "accurate": vertices about 4, 3 or 2 cm apart.
            fabric: fabric; None for a woven tablecloth.
            marker: whether a strip of 3 cm along the rows' first eighth has the other side's color,
                as in SoftGym's folding tasks, to mark the half to fold over.
            name: model name.
            dims: (dimx, dimy) in SoftGym particles, each 10..200, instead of `size`.

        Raises:
            InvalidArgumentError: for a bad fidelity or size, or both sizes.
        """
        check_name("fidelity", fidelity, FIDELITIES)
        self._fidelity = fidelity
        self._start_sheet(name, fabric, has_strip=marker)
        self.dims = (0, 0)
        if size is not None and dims is not None:
            raise InvalidArgumentError("dims", dims, "None, because `size` is given")
        if dims is None:
            dims = DEFAULT_DIMS if size is None else _dims(size)
        self.resize(dims)

    @property
    def size(self) -> tuple[float, float]:
        """Side lengths (along columns, along rows) [m]."""
        return (self.dims[0] - 1) * PARTICLE_SPACING, (self.dims[1] - 1) * PARTICLE_SPACING

    @property
    def corners(self) -> np.ndarray:
        """Vertex indices (4,) of SoftGym's key points p1..p4.

        p1 = (row 0, column 0), p2 = (last row, column 0), p3 = (row 0, last column), p4 = last.
        """
        rows, columns = self.shape
        last = rows * columns - 1
        return np.array([0, last - columns + 1, columns - 1, last])

    def index(self, row: int, column: int) -> int:
        """Returns the vertex index of a grid node; negative rows and columns count from the end."""
        rows, columns = self.shape
        if not (-rows <= row < rows and -columns <= column < columns):
            raise InvalidArgumentError("(row, column)", (row, column), f"a grid of {self.shape}")
        return (row % rows) * columns + column % columns

    def grid(self) -> np.ndarray:
        """Returns current vertex positions (rows, columns, 3) [m]."""
        return self.points().reshape(*self.shape, 3)

    def particles(self, vertices: np.ndarray | None = None) -> np.ndarray:
        """Returns positions (dimy, dimx, 3) [m] of SoftGym's particles on the mesh.

        Args:
            vertices: (num_points, 3) positions [m]; None for the current ones.
        """
        return metrics.particles(self.arrays, self.points() if vertices is None else vertices)

    def flat(self, center: tuple[float, float] = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
        """Returns vertex positions (num_points, 3) [m] of the flat cloth on the floor.

        Args:
            center: (X, Y) of its center [m].
            angle: rotation about +Z [rad].
        """
        return self._turned(self._rest_points, center, angle)

    def resize(self, dims: tuple[int, int]) -> bool:
        """Resizes the cloth; returns True if the model changed and must be recompiled."""
        if len(dims) != 2 or not all(MIN_DIM <= dim <= MAX_DIM for dim in dims):
            raise InvalidArgumentError("dims", dims, f"two sizes in {MIN_DIM}..{MAX_DIM} particles")
        dims = (int(dims[0]), int(dims[1]))
        if dims == self.dims:
            return False
        self.dims = dims
        self.shape = grid_shape(dims, self._fidelity)
        rows, columns = self.shape
        width, depth = self.size
        x, y = np.meshgrid(
            np.linspace(-width / 2, width / 2, columns), np.linspace(depth / 2, -depth / 2, rows)
        )
        points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        self._set_mesh(points, alternating_triangles(rows, columns))
        half = dims[0] // 2
        self.arrays = {
            "size": np.array(self.size),
            "triangles": self.triangles,
            "corners": self.corners,
            "key_points": (_evenly(rows)[:, None] * columns + _evenly(columns)).ravel(),
            "grid": np.arange(rows * columns).reshape(rows, columns),
            "by_row": _interpolation(dims[1], rows),
            "by_column": _interpolation(dims[0], columns),
            "rows": np.ones(dims[1]),
            "columns": np.ones(dims[0]),
            "first_half": np.arange(half),
            "second_half": dims[0] - 1 - np.arange(half),
            "pairs": np.ones(half),
        }
        return True

    def _mass(self, density: float) -> float:
        return density * self.size[0] * self.size[1]

    def _skin(self, refinement: int) -> tuple[sparse.csr_array, np.ndarray, np.ndarray]:
        rows, columns = (np.linspace(0, n - 1, (n - 1) * refinement + 1) for n in self.shape)
        # The strip: 5 of SoftGym's quads along the rows, from an eighth of them on.
        first = (self.dims[0] - 1) // 8
        strip = np.array([first, first + 5]) / (self.dims[0] - 1)
        columns = np.union1d(columns, strip * columns[-1])
        u = np.interp(columns / columns[-1], [0.0, *strip, 1.0], [0.0, *STRIP, 1.0])
        u, v = np.meshgrid(u, rows / rows[-1])
        splines = spline(self.shape[0], rows), spline(self.shape[1], columns)
        weights = sparse.csr_array(sparse.kron(*map(sparse.csr_array, splines)))
        # Its front is below when its grid is seen from above.
        faces = alternating_triangles(len(rows), len(columns))[:, ::-1]
        inset = PAD + (1.0 - 2.0 * PAD) * np.column_stack([u.ravel(), v.ravel()])
        return weights, faces, inset


def _dims(size: tuple[float, float]) -> tuple[int, int]:
    """Returns the size (dimx, dimy) in particles of a cloth with these side lengths [m]."""
    low, high = ((dim - 1) * PARTICLE_SPACING for dim in (MIN_DIM, MAX_DIM))
    if not all(low <= side <= high for side in size):
        raise InvalidArgumentError("size", size, f"two lengths in {low:.3f}..{high:.3f} m")
    dimx, dimy = (round(side / PARTICLE_SPACING) + 1 for side in size)
    return dimx, dimy


def _evenly(number: int) -> np.ndarray:
    """Returns `KEY_POINTS` of the indices below a number, evenly spaced."""
    return np.linspace(0, number - 1, KEY_POINTS).round().astype(int)


def _interpolation(particles: int, vertices: int) -> np.ndarray:
    """Returns weights (particles, vertices) of evenly spaced particles on a line of vertices."""
    place = np.linspace(0, vertices - 1, particles)
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(vertices)), 0.0)


def alternating_triangles(rows: int, columns: int) -> np.ndarray:
    """Returns triangles (m, 3) of a grid with alternating diagonals, for isotropic bending."""
    triangles = []
    for row in range(rows - 1):
        for column in range(columns - 1):
            a = row * columns + column
            b, c, d = a + 1, a + columns, a + columns + 1
            if (row + column) % 2 == 0:
                triangles += [(a, c, b), (b, c, d)]
            else:
                triangles += [(a, c, d), (a, d, b)]
    return np.array(triangles)
