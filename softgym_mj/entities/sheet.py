"""`Sheet`: a two-dimensional flex with two coloured sides, the base of `Cloth` and `Garment`."""

import abc
import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from softgym_mj import metrics
from softgym_mj.domain import Parameter, scaled, shifted, turned
from softgym_mj.entities import contact
from softgym_mj.entities.flex import Flex
from softgym_mj.exceptions import OutOfRangeError, check_name

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
TIMESTEP = 0.01  # [s]: the discrete integrator is implicit, one solve a sim step is enough.

FRONT_COLOR = (0.92, 0.29, 0.59, 1.0)  # SoftGym's pink-magenta.
BACK_COLOR = (1.0, 0.40, 0.10, 1.0)  # SoftGym's orange.
# Each face is drawn this far [m] from the mid-surface, so that the two do not fight for depth.
SKIN_OFFSET = 0.0015

SELF_CONTACTS = ("plugin", "mujoco", "none")


@dataclasses.dataclass(frozen=True)
class Fabric:
    """What a sheet is made of; the defaults are shirting cotton.

    Attributes:
        stretch_stiffness: force per width and strain [N/m].
        bend_stiffness: moment per width and curvature [N m].
        density: mass of a unit of area [kg/m^2].
        friction: on the floor.
        layer_friction: between layers.

    Raises:
        OutOfRangeError: unless all are finite and above 0.
    """

    stretch_stiffness: float = STRETCH_STIFFNESS
    bend_stiffness: float = BEND_STIFFNESS
    density: float = AREA_DENSITY
    friction: float = FRICTION
    layer_friction: float = contact.LAYER_FRICTION

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if not 0.0 < value < np.inf:
                raise OutOfRangeError(name, value, "finite and above 0")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Domain parameters of a sheet that is made of it."""
        return (
            scaled(
                "stretch_stiffness", "N/m", self.stretch_stiffness, 1.4, 2.0,
                "force per width and strain",
            ),
            scaled(
                "bend_stiffness", "N m", self.bend_stiffness, 2.0, 5.0,
                "moment per width and curvature",
            ),
            scaled("density", "kg/m^2", self.density, 1.4, 2.0, "mass of a unit of area"),
            scaled("friction", "", self.friction, 1.2, 1.6, "on the floor"),
            contact.layer_friction(self.layer_friction),
            shifted("hue", "deg", 20.0, 90.0, "by which colours are turned"),
        )  # fmt: skip


class Sheet(Flex):
    """Triangles that stretch and bend, drawn as two skins: one for each side."""

    def _start_sheet(
        self,
        name: str,
        self_contact: str | contact.FlexContact,
        fabric: Fabric,
        iterations: int,
        colors: Mapping[str, Sequence[float]],
    ) -> None:
        """To be called first in a subclass's `_build`.

        Args:
            name: model name.
            self_contact: one of `SELF_CONTACTS`, or the contact that it shares with other flexes.
            fabric: what it is made of.
            iterations: of the solver, so many that it converges.
            colors: (r, g, b, a) in 0..1 of materials by name.

        Raises:
            UnknownNameError: for a bad self_contact.
        """
        self._colors = colors
        self._parameters = fabric.parameters
        if isinstance(self_contact, contact.FlexContact):
            self._share(self_contact)
            # The friction between layers is a parameter of what they share.
            self._parameters = tuple(p for p in fabric.parameters if p.name != "layer_friction")
        else:
            check_name("self_contact", self_contact, SELF_CONTACTS)
            self._self_contact = self_contact
        self._start_model(name)
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
        option.iterations = iterations
        # With MuJoCo's self-collision, 1e-4 stops short of balance: piles tremble at 0.1 m/s and
        # stretch by 13 %.
        option.tolerance = 1e-4 if self._self_contact == "plugin" else 1e-5
        self._mjcf_root.size.memory = "64M"  # A crumpled 32 x 31 cloth uses 7 MB.
        for material, color in colors.items():
            self._mjcf_root.asset.add(
                "material", name=material, rgba=color, specular=0.1, shininess=0.1
            )
        self._own_instance = None
        if self_contact == "plugin":
            self._own_instance = contact.add_instance(self._mjcf_root)

    @property
    def physical_parameters(self) -> dict[str, dict[str, object]]:
        friction = self._values.get("layer_friction")
        return {
            **super().physical_parameters,
            "self_contact": {"mode": self.self_contact, "friction": friction},
        }

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return self._parameters

    @property
    def timestep(self) -> float:
        return TIMESTEP

    @property
    def triangles(self) -> np.ndarray:
        """Vertex indices (num_triangles, 3)."""
        return self._triangles

    def intersections(self) -> int:
        """Number of places where the sheet passes through itself now (some milliseconds)."""
        return metrics.count_intersections(self.vertices(), self.edges, self.triangles)

    def _set_mesh(self, points: np.ndarray, triangles: np.ndarray, radius: float) -> None:
        """(Re)places the mesh by `points` (n, 3) [m] and `triangles` (m, 3)."""
        self._triangles = triangles
        flexcomp = self._add_flexcomp(
            points, triangles, radius=radius, rgba=next(iter(self._colors.values()))
        )
        # The flex itself is hidden (group 4): the skins below show its two sides.
        flexcomp.elasticity.poisson = POISSON
        flexcomp.elasticity.damping = DAMPING
        flexcomp.elasticity.elastic2d = "both"
        flexcomp.edge.equality = "false"
        flexcomp.contact.selfcollide = "auto" if self._self_contact == "mujoco" else "none"
        flexcomp.contact.condim = 3
        flexcomp.contact.solref = [0.01, 1]  # Twice as stiff as default: 5 mm layers stay apart.
        flexcomp.group = 4
        if self._own_instance is not None:
            contact.keep_apart(flexcomp, self._own_instance)
        self._mjcf_root.deformable.skin.clear()
        for name, material, faces in self._skins():
            self._add_skin(name, material, points, faces)
        self._set_parameters()

    def _set_parameters(self):
        values = self._values
        # The one goes with E t, the other with E t^3.
        stiffer = values["stretch_stiffness"] / STRETCH_STIFFNESS
        thicker = (values["bend_stiffness"] / BEND_STIFFNESS / stiffer) ** 0.5
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        flexcomp.elasticity.young = YOUNG * stiffer / thicker
        flexcomp.elasticity.thickness = THICKNESS * thicker
        flexcomp.mass = self._mass(values["density"])
        flexcomp.contact.friction = [values["friction"]]
        if self._own_instance is not None:
            contact.set_friction(self._own_instance, values["layer_friction"])
        for material, color in zip(
            self._mjcf_root.asset.material, self._colors.values(), strict=True
        ):
            material.rgba = turned(color, values["hue"])

    @abc.abstractmethod
    def _mass(self, density: float) -> float:
        """Mass [kg] of the sheet with so many [kg/m^2]."""

    @abc.abstractmethod
    def _skins(self) -> Iterator[tuple[str, str, np.ndarray]]:
        """Name, material and faces (m, 3), seen from where they are counter-clockwise, of skins.

        A skin has one normal a vertex, so what is turned round is a skin of its own.
        """

    def _add_skin(self, name: str, material: str, points: np.ndarray, faces: np.ndarray):
        skin = self._mjcf_root.deformable.add(
            "skin",
            name=name,
            material=material,
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
