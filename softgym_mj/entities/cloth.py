"""`Cloth`: a rectangular sheet of woven cotton as a two-dimensional MuJoCo flex."""

import dataclasses

import numpy as np

from softgym_mj import metrics
from softgym_mj.domain import Parameter, scaled, shifted, turned
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import OutOfRangeError, check_name
from softgym_mj.fluid.library import CLOTH_CONTACT, load_plugin

# SoftGym counts cloth sizes in FleX particles this far apart [m]; a side is (dim - 1) of them.
PARTICLE_SPACING = 0.00625
MIN_DIM, MAX_DIM = 10, 200  # Accepted sizes in particles: 0.06 m to 1.24 m.
DEFAULT_DIMS = (96, 58)  # SoftGym's size when variations are off (facts 3.0).

# Resting height in SoftGym is 5 mm; two layers then rest 10 mm apart (FleX: 11.25 mm).
RADIUS = 0.005
AREA_DENSITY = 0.2  # [kg/m^2], shirting cotton. FleX's dynamics do not depend on the mass.
YOUNG = 2e5  # [Pa]
THICKNESS = 5e-4  # [m]
POISSON = 0.2
# What MuJoCo 3.17 makes of them in a flex of dimension 2, measured: a third of the membrane
# stiffness E t of a sheet and 0.6 of its bending rigidity E t^3 / 12. With 33 N/m the 99th
# percentile of edge strain stays below 10 % in a fold at 0.6 m/s; real cotton is 30 times stiffer,
# at which CG no longer converges at this time step. 1.25e-6 N m is within the range of cotton.
STRETCH_STIFFNESS = YOUNG * THICKNESS / 3  # [N/m]
BEND_STIFFNESS = 0.6 * YOUNG * THICKNESS**3 / 12  # [N m]
DAMPING = 0.01  # [s], Rayleigh: one sim step; a dropped cloth rests after about a second.
# On the floor. SoftGym has 0.75 and freezes what is slower than 2 cm/s; with 0.75 alone some heaps
# spread by a fifth in 8 s of doing nothing.
FRICTION = 1.0
LAYER_FRICTION = 0.75  # Between layers.
# MuJoCo reports contacts from this distance [m] on, so that the plugin can stop vertices at the
# floor that layers above push down; it needs what a vertex falls in a step (1 mm) and some more.
GAP = 0.003
TIMESTEP = 0.01  # [s]: the discrete integrator is implicit, one solve a sim step is enough.

FRONT_COLOR = (0.92, 0.29, 0.59, 1.0)  # SoftGym's pink-magenta.
BACK_COLOR = (1.0, 0.40, 0.10, 1.0)  # SoftGym's orange.

PARAMETERS = (
    scaled("stretch_stiffness", "N/m", STRETCH_STIFFNESS, 1.4, 2.0, "force per width and strain"),
    scaled("bend_stiffness", "N m", BEND_STIFFNESS, 2.0, 5.0, "moment per width and curvature"),
    scaled("density", "kg/m^2", AREA_DENSITY, 1.4, 2.0, "mass of a unit of area"),
    scaled("friction", "", FRICTION, 1.2, 1.6, "on the floor"),
    scaled("layer_friction", "", LAYER_FRICTION, 1.2, 1.6, "between layers"),
    shifted("hue", "deg", 20.0, 90.0, "by which colours are turned"),
)
# Each face is drawn this far [m] from the mid-surface, so that the two do not fight for depth.
SKIN_OFFSET = 0.0015


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Resolution of a cloth: vertex spacing [m] and solver iterations that converge there."""

    spacing: float
    iterations: int


FIDELITIES = {
    "fast": Fidelity(spacing=0.04, iterations=250),
    "default": Fidelity(spacing=0.03, iterations=200),
    "accurate": Fidelity(spacing=0.02, iterations=300),
}
SELF_CONTACTS = ("plugin", "mujoco", "none")


def grid_shape(dims: tuple[int, int], fidelity: str) -> tuple[int, int]:
    """Number of vertex (rows, columns) of a cloth of `dims` = (dimx, dimy) particles."""
    check_name("fidelity", fidelity, FIDELITIES)
    spacing = FIDELITIES[fidelity].spacing
    columns, rows = (round((dim - 1) * PARTICLE_SPACING / spacing) + 1 for dim in dims)
    return rows, columns


class Cloth(Flex):
    """A sheet of (rows, columns) vertices; row 0 lies at +Y, column 0 at -X, front side down.

    This is SoftGym's order (index = row * columns + column, columns along x, rows along z) in
    z-up coordinates, where FleX's z is -Y.
    """

    def _build(
        self,
        dims: tuple[int, int] = DEFAULT_DIMS,
        fidelity: str = "default",
        self_contact: str = "plugin",
        marker: bool = False,
        name: str = "cloth",
    ):
        """Builds the cloth.

        Args:
            dims: (dimx, dimy) size in SoftGym particles, each 10..200.
            fidelity: "fast", "default" or "accurate".
            self_contact: "plugin" for softgym_mj.cloth_contact, "mujoco" for MuJoCo's own flex
                self-collision (two to three times slower on folded cloth, and fast layers come
                through each other), "none" for none.
            marker: whether a strip of 3 cm along the rows' first eighth shows the other side's
                colour, as in SoftGym's folding tasks: it tells which half is to be folded over.
            name: model name.

        Raises:
            UnknownNameError, OutOfRangeError: for a bad fidelity, self_contact or size.
        """
        self._start_model(name)
        check_name("fidelity", fidelity, FIDELITIES)
        check_name("self_contact", self_contact, SELF_CONTACTS)
        self._fidelity, self._self_contact = fidelity, self_contact
        self._marker = marker
        option = self._mjcf_root.option
        # Flex elasticity is far too stiff for an explicit step of 10 ms; `discrete` is implicit
        # in position. CG is 5 to 15 times faster than Newton on a cloth in contact.
        option.integrator, option.solver, option.jacobian = "discrete", "CG", "sparse"
        # With pyramidal cones a folded cloth trembles, and costs a third more.
        option.cone = "elliptic"
        # Friction that hardly slips: with 1, crumples spread by 9 % in 8 s of doing nothing. FleX
        # freezes whatever is slower than 2 cm/s for the same end.
        option.impratio = 10
        option.timestep = TIMESTEP
        option.iterations = FIDELITIES[fidelity].iterations
        # With MuJoCo's self-collision, 1e-4 stops short of balance: piles tremble at 0.1 m/s and
        # stretch by 13 %.
        option.tolerance = 1e-4 if self_contact == "plugin" else 1e-5
        self._mjcf_root.size.memory = "64M"  # A crumpled 32 x 31 cloth uses 7 MB.
        for side, color in (("front", FRONT_COLOR), ("back", BACK_COLOR)):
            self._mjcf_root.asset.add(
                "material", name=side, rgba=color, specular=0.1, shininess=0.1
            )
        if self_contact == "plugin":
            load_plugin()
            plugin = self._mjcf_root.extension.add("plugin", plugin=CLOTH_CONTACT)
            self._contact = plugin.add("instance", name="contact")
            self._contact.add("config", key="friction")
        self._dims = (0, 0)
        self.resize(dims)

    @property
    def physical_parameters(self) -> dict[str, dict[str, object]]:
        return {
            **super().physical_parameters,
            "self_contact": {"mode": self.self_contact, "friction": self._values["layer_friction"]},
        }

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return PARAMETERS

    @property
    def timestep(self) -> float:
        return TIMESTEP

    @property
    def dims(self) -> tuple[int, int]:
        """Size (dimx, dimy) in SoftGym particles."""
        return self._dims

    @property
    def size(self) -> tuple[float, float]:
        """Side lengths (along columns, along rows) [m]."""
        return (self._dims[0] - 1) * PARTICLE_SPACING, (self._dims[1] - 1) * PARTICLE_SPACING

    @property
    def shape(self) -> tuple[int, int]:
        """Number of vertex (rows, columns)."""
        return self._shape

    @property
    def corners(self) -> np.ndarray:
        """Vertex indices (4,) of SoftGym's key points p1..p4.

        p1 = (row 0, column 0), p2 = (last row, column 0), p3 = (row 0, last column), p4 = last.
        """
        rows, columns = self._shape
        last = rows * columns - 1
        return np.array([0, last - columns + 1, columns - 1, last])

    @property
    def triangles(self) -> np.ndarray:
        """Vertex indices (num_triangles, 3), counter-clockwise from above when laid flat."""
        return self._triangles

    def index(self, row: int, column: int) -> int:
        """Vertex index of a grid node; negative rows and columns count from the end."""
        rows, columns = self._shape
        if not (-rows <= row < rows and -columns <= column < columns):
            raise OutOfRangeError("(row, column)", (row, column), f"a grid of {self._shape}")
        return (row % rows) * columns + column % columns

    def grid(self) -> np.ndarray:
        """Current vertex positions (rows, columns, 3) [m]."""
        return self.vertices().reshape(*self._shape, 3)

    def particles(self, vertices: np.ndarray | None = None) -> np.ndarray:
        """Positions (dimy, dimx, 3) [m] of SoftGym's particles on the mesh.

        Args:
            vertices: (num_vertices, 3) positions [m]; the current ones when None.
        """
        grid = (self.vertices() if vertices is None else vertices).reshape(*self._shape, 3)
        by_row, by_column = self._interpolation
        return np.einsum("jr,rck->jck", by_row, np.einsum("ic,rck->rik", by_column, grid))

    def flat(self, centre: tuple[float, float] = (0.0, 0.0), angle: float = 0.0) -> np.ndarray:
        """Vertex positions (num_vertices, 3) [m] of the cloth lying flat at its resting height.

        Args:
            centre: (X, Y) of its centre [m].
            angle: rotation about +Z [rad].
        """
        cosine, sine = np.cos(angle), np.sin(angle)
        positions = self._rest_points @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
        return positions + np.array([*centre, RADIUS])

    def intersections(self) -> int:
        """Number of places where the cloth passes through itself now (some milliseconds)."""
        return metrics.count_intersections(self.vertices(), self.edges, self.triangles)

    def resize(self, dims: tuple[int, int]) -> bool:
        """Gives the cloth another size; True when the model changed and must be recompiled."""
        if len(dims) != 2 or not all(MIN_DIM <= dim <= MAX_DIM for dim in dims):
            raise OutOfRangeError("dims", dims, f"two sizes in {MIN_DIM}..{MAX_DIM} particles")
        dims = (int(dims[0]), int(dims[1]))
        if dims == self._dims:
            return False
        self._dims = dims
        self._shape = grid_shape(dims, self._fidelity)
        rows, columns = self._shape
        width, depth = self.size
        self._interpolation = _interpolation(dims[1], rows), _interpolation(dims[0], columns)
        x, y = np.meshgrid(
            np.linspace(-width / 2, width / 2, columns), np.linspace(depth / 2, -depth / 2, rows)
        )
        points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        self._triangles = _alternating_triangles(rows, columns)
        flexcomp = self._add_flexcomp(
            points,
            self._triangles,
            radius=RADIUS,
            rgba=FRONT_COLOR,
        )
        # The flex itself is hidden (group 4): the two skins below show its two sides.
        flexcomp.elasticity.poisson = POISSON
        flexcomp.elasticity.damping = DAMPING
        flexcomp.elasticity.elastic2d = "both"
        flexcomp.edge.equality = "false"
        flexcomp.contact.selfcollide = "auto" if self._self_contact == "mujoco" else "none"
        flexcomp.contact.condim = 3
        flexcomp.contact.solref = [0.01, 1]  # Twice as stiff as default: 5 mm layers stay apart.
        flexcomp.group = 4
        if self._self_contact == "plugin":
            flexcomp.contact.gap = GAP
            flexcomp.add("plugin", plugin=CLOTH_CONTACT, instance=self._contact)
        self._add_skins(points)
        self._set_parameters()
        return True

    def _set_parameters(self):
        stretch, bend, density, friction, layer_friction, hue = (
            self._values[parameter.name] for parameter in PARAMETERS
        )
        # The one goes with E t, the other with E t^3.
        stiffer = stretch / STRETCH_STIFFNESS
        thicker = (bend / BEND_STIFFNESS / stiffer) ** 0.5
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        flexcomp.elasticity.young = YOUNG * stiffer / thicker
        flexcomp.elasticity.thickness = THICKNESS * thicker
        flexcomp.mass = density * self.size[0] * self.size[1]
        flexcomp.contact.friction = [friction]
        if self._self_contact == "plugin":
            self._contact.config[0].value = str(layer_friction)
        for material, color in zip(
            self._mjcf_root.asset.material, (FRONT_COLOR, BACK_COLOR), strict=True
        ):
            material.rgba = turned(color, hue)

    def _marked_quads(self) -> np.ndarray:
        """Columns of quads that the marker covers: 5 of SoftGym's from an eighth on, at least 1."""
        first = (self._dims[0] - 1) // 8
        ends = np.array([first, first + 5]) / (self._dims[0] - 1) * (self._shape[1] - 1)
        low, high = np.round(ends).astype(int)
        return np.arange(low, max(high, low + 1))

    def _add_skins(self, points: np.ndarray):
        self._mjcf_root.deformable.skin.clear()
        up = np.ones(len(self._triangles), bool)
        if self._marker:
            quad = np.arange(len(self._triangles)) // 2 % (self._shape[1] - 1)
            up = ~np.isin(quad, self._marked_quads())
        down = self._triangles[:, ::-1]
        # A skin has one normal a vertex, so what is turned round is a skin of its own.
        for name, side, faces in (
            ("front", "front", down[up]),
            ("back", "back", self._triangles[up]),
            ("marker_front", "back", down[~up]),
            ("marker_back", "front", self._triangles[~up]),
        ):
            if not len(faces):
                continue
            skin = self._mjcf_root.deformable.add(
                "skin",
                name=name,
                material=side,
                inflate=SKIN_OFFSET,
                vertex=points.ravel(),
                face=faces.ravel(),
            )
            for vertex, point in enumerate(points):
                skin.add(
                    "bone",
                    body=self.vertex_body(vertex),
                    bindpos=point,
                    bindquat=[1, 0, 0, 0],
                    vertid=[vertex],
                    vertweight=[1.0],
                )


def _interpolation(particles: int, vertices: int) -> np.ndarray:
    """Weights (particles, vertices) that place evenly spaced particles on a line of vertices."""
    place = np.linspace(0, vertices - 1, particles)
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(vertices)), 0.0)


def _alternating_triangles(rows: int, columns: int) -> np.ndarray:
    """Triangles (m, 3) of a grid whose diagonals alternate, so that no direction bends easier."""
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
