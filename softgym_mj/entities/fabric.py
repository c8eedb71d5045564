"""`Fabric`: physical parameters of a sheet, for the solver and domain randomization."""

import dataclasses
from collections.abc import Mapping

from softgym_mj.cloth import fabrics
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.patterns import FABRICS
from softgym_mj.validation import typed
from softgym_mj.variations.randomization import (
    Parameter,
    choice_parameter,
    scaled_parameter,
    shifted_parameter,
)

# [m] Resting height in SoftGym is 5 mm; two layers then rest 10 mm apart (FleX: 11.25 mm).
THICKNESS = 0.01
# A tablecloth of polyester, woven: "white dots" of Wang, O'Brien and Ramamoorthi (Data-driven
# elastic models for cloth, 2011), 12.9, 10.2 and 7.8 uN m along warp, bias and weft. Its gravity
# bending length (B / (density g))^(1/3), 20 mm, is in the middle of those of 618 measured fabrics
# (Feng et al., 2022: nine in ten of this weight have 14 mm and more), and it is what the tasks
# handle. Limper ones are mostly knits, which stretch visibly.
AREA_DENSITY, BEND_STIFFNESS = 0.128, 1.03e-5  # [kg/m^2], [N m]

# In a grid of squares, each with one diagonal, the diagonals are springs of stretch / 1.2 times a
# half times `shear`: sheared by an angle g they lengthen by l g / sqrt 2, so the sheet resists with
# stretch times shear / 4.8 per width and angle.
_SHEAR = 4.8
_LINES = 1.2  # Stretch stiffness over that of a grid's lines per width.
_LEAST_SHEAR = 1e-3  # The solver's lower limit.
_MAY_BE_NONE = (
    "drag",
    "added_mass",
    "bend_weft",
    "bend_bias",
    "stiffening",
)  # These parameters may be 0.


@typed
@dataclasses.dataclass(frozen=True)
class Fabric:
    """Physical parameters of a sheet; the defaults are a woven tablecloth.

    Attributes:
        stretch_stiffness: force per width and strain [N/m].
        shear: stiffness along the mesh's diagonals as a share of that along its other edges.
        bend_stiffness: moment per width and curvature [N m].
        bend_weft: if above 0, the sheet bends as an anisotropic plate with this stiffness along Y
            and `bend_stiffness` along X of the sheet when it is built, and a grid stretches by
            exactly the nominal stiffness. 0, as for the tasks' cloth, for equal bending of all
            edges: stiffer than nominal at sharp bends, and an eighth more compliant in stretch
            where it is soft.
        bend_bias: bending stiffness of a plate at 45 degrees between them; 0 for the mean of both.
        stiffening: growth s of the stretch stiffness k with strain e in tension: force per width
            k e (1 + s e). 0, as for the tasks' cloth, for woven fabrics; knits have 16 to 123.
        stretch_damping, bend_damping: dashpots as a multiple of the stiffness [s].
        density: mass per area [kg/m^2].
        thickness: distance of layers; on the floor, vertices are at half of it [m].
        friction: friction coefficient on the floor.
        layer_friction: friction coefficient between layers.
        drag: drag coefficient of air for motion along the normal; 0 without air.
        added_mass: mass of air that moves with the sheet along its normal [kg/m^2]; for a free
            strip of width w, pi/4 w 1.2 kg/m^3. It slows folds down.

    Raises:
        InvalidArgumentError: unless all are finite and above 0, or 0 where that is allowed.
    """

    # A tenth of the real stiffness, about the largest for a sheet so light with substeps of 0.4 ms.
    # Strain stays below 3 % at 0.6 m/s.
    stretch_stiffness: float = 400.0
    # Real values are ten times smaller, but then folds do not keep their shape at 3 cm.
    shear: float = 0.3
    bend_stiffness: float = BEND_STIFFNESS
    stretch_damping: float = 1e-3
    bend_damping: float = 0.05
    density: float = AREA_DENSITY
    thickness: float = THICKNESS
    # SoftGym has 0.75 and freezes vertices slower than 2 cm/s; with 0.75 alone some piles spread by
    # a fifth in 8 s at rest.
    friction: float = 1.0
    layer_friction: float = 0.75
    drag: float = 1.2  # Drag coefficient of a plate across the flow.
    added_mass: float = 0.0
    bend_weft: float = 0.0
    bend_bias: float = 0.0
    stiffening: float = 0.0

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if not (value > 0.0 or (name in _MAY_BE_NONE and value == 0.0)):
                raise InvalidArgumentError(name, value, "finite and above 0")

    @classmethod
    def named(
        cls,
        name: str,
        *,
        anisotropic: bool = False,
        measured_shear: bool = False,
        measured_stiffening: bool = False,
    ) -> "Fabric":
        """Returns a measured fabric, as far as a sheet can represent it.

        It bends as a plate: a strip of it hangs as the fabric does, whatever its mesh (`softgym-mj
        validate lab`). Stretch is the mean of both directions. Damping, thickness and `shear` are
        the defaults: a mesh of 3 cm cannot follow the published shear stiffness, and its folds
        would not keep their shape.

        Args:
            name: name in `softgym_mj.cloth.fabrics.FABRICS`.
            anisotropic: whether it bends along warp (X of the sheet when it is built), bias and
                weft as measured; else equally, by their mean.
            measured_shear: whether `shear` reproduces the measured shear stiffness, as far as
                possible.
            measured_stiffening: whether a knit stiffens with strain as measured.

        Raises:
            InvalidArgumentError: if there is no such fabric.
        """
        data = fabrics.named(name)
        warp, bias, weft = data.bending if anisotropic else (data.mean_bending,) * 3
        shear = min(max(_SHEAR * data.shear / data.mean_stretch, _LEAST_SHEAR), 1.0)
        return cls(
            stretch_stiffness=data.mean_stretch,
            shear=shear if measured_shear else cls.shear,
            stiffening=data.stiffening if measured_stiffening else cls.stiffening,
            bend_stiffness=warp,
            bend_weft=weft,
            bend_bias=bias,
            density=data.density,
            friction=data.friction,
            layer_friction=data.layer_friction,
            drag=data.drag,
            added_mass=data.added_mass,
        )

    def material(self) -> dict[str, float]:
        """Returns attributes of `solver.Material` by name."""
        return solver_material(dataclasses.asdict(self))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Domain parameters of a sheet of this fabric."""
        return (
            scaled_parameter(
                "stretch_stiffness", "N/m", self.stretch_stiffness, 1.4, 2.0,
                "force per width and strain",
            ),
            scaled_parameter(
                "shear", "", self.shear, 1.4, 2.0, "stiffness of diagonals over that of edges"
            ),
            scaled_parameter(
                "bend_stiffness", "N m", self.bend_stiffness, 2.0, 5.0,
                "moment per width and curvature",
            ),
            _of_plates("bend_weft", self.bend_weft, "bending along Y; 0 for isotropic"),
            _of_plates("bend_bias", self.bend_bias, "bending at 45 deg; 0 for the mean"),
            Parameter(  # Presets do not vary it.
                "stiffening", "", self.stiffening, (self.stiffening,) * 2,
                (0.0, _MOST_STIFFENING), "growth of the stretch stiffness with strain",
            ),
            scaled_parameter(
                "stretch_damping", "s", self.stretch_damping, 2.0, 5.0, "damping time"
            ),
            scaled_parameter("bend_damping", "s", self.bend_damping, 2.0, 5.0, "damping time"),
            scaled_parameter("density", "kg/m^2", self.density, 1.4, 2.0, "mass per area"),
            scaled_parameter("thickness", "m", self.thickness, 1.2, 1.6, "distance of layers"),
            scaled_parameter("friction", "", self.friction, 1.2, 1.6, "friction on the floor"),
            scaled_parameter(
                "layer_friction", "", self.layer_friction, 1.2, 1.6, "friction between layers"
            ),
            Parameter(
                "drag", "", self.drag, (0.5 * self.drag, 1.5 * self.drag),
                (0.0, 2.0 * self.drag), "drag coefficient of air along the normal",
            ),
            Parameter(
                "added_mass", "kg/m^2", self.added_mass, (0.0, max(self.added_mass, 0.1)),
                (0.0, max(2.0 * self.added_mass, 0.5)), "added mass of air",
            ),
            shifted_parameter("hue", "deg", 20.0, 90.0, "hue rotation of colors", "visual"),
            Parameter(
                "brightness", "", 1.0, (0.8, 1.0), (0.65, 1.0), "factor on colors", "visual"
            ),
            choice_parameter("pattern", FABRICS, 3, "pattern of the front, fainter on the back"),
        )  # fmt: skip


_MOST_STIFFENING = 200.0  # Upper limit, above all measured knits.
_MOST_BEND = 1e-3  # [N m] Upper limit, stiffer than any fabric.


def _of_plates(name: str, nominal: float, summary: str) -> Parameter:
    """Returns a stiffness parameter that presets do not vary, unless the sheet is a plate."""
    if nominal > 0.0:
        return scaled_parameter(name, "N m", nominal, 2.0, 5.0, summary)
    return Parameter(name, "N m", 0.0, (0.0, 0.0), (0.0, _MOST_BEND), summary)


def _stretch_factor(shear: float) -> float:
    """Returns the factor on a grid's stretch stiffness that yields the nominal one.

    Its lines are springs of stretch / 1.2 a width. A cell's diagonal adds shear / 4 of that along
    the lines and pulls as much across them, while a strip is free to contract.
    """
    along, across = 1.0 + shear / 4.0, shear / 4.0
    return _LINES / (along - across**2 / along)


def solver_material(values: Mapping[str, float]) -> dict[str, float]:
    """Returns attributes of `solver.Material` by name, for those of a `Fabric` by name."""
    stretch, stiffening = values["stretch_stiffness"], values["stiffening"]
    if values["bend_weft"] > 0.0:
        factor = _stretch_factor(values["shear"])
        # Diagonals do not stiffen, so the lines have to for them.
        stretch, stiffening = stretch * factor, stiffening * _LINES / factor
    return {
        "stretch": stretch,
        "stiffening": stiffening,
        "shear": values["shear"],
        "bend": values["bend_stiffness"],
        "bend_weft": values["bend_weft"],
        "bend_bias": values["bend_bias"],
        "stretch_damping": values["stretch_damping"],
        "bend_damping": values["bend_damping"],
        "friction": values["layer_friction"],
        "drag": values["drag"],
        "added_mass": values["added_mass"],
    }
