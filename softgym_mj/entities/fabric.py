"""`Fabric`: what a sheet is made of, and how the solver and domain randomization see it."""

import dataclasses
from collections.abc import Mapping

from softgym_mj.cloth import fabrics
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.patterns import FABRICS
from softgym_mj.validation import typed
from softgym_mj.variations.randomization import Parameter, chosen, scaled, shifted

# [m] Resting height in SoftGym is 5 mm; two layers then rest 10 mm apart (FleX: 11.25 mm).
THICKNESS = 0.01
# A tablecloth of polyester, woven: "white dots" of Wang, O'Brien and Ramamoorthi (Data-driven
# elastic models for cloth, 2011), 12.9, 10.2 and 7.8 uN m along warp, bias and weft. Its gravity
# bending length (B / (density g))^(1/3), 20 mm, is in the middle of those of 618 measured fabrics
# (Feng et al., 2022: nine in ten of this weight have 14 mm and more), and it is what the tasks
# handle. Limper ones are mostly knits, which stretch visibly.
AREA_DENSITY, BEND_STIFFNESS = 0.128, 1.03e-5  # [kg/m^2], [N m]

# Of a grid of squares whose inner diagonals, one in each, are springs of stretch / 1.2 times a half
# times `shear`: sheared by an angle g they get longer by l g / sqrt 2, so that the sheet resists
# with stretch times shear / 4.8 per width and angle.
_SHEAR = 4.8
_LEAST_SHEAR = 1e-3  # That the solver takes.
_MAY_BE_NONE = ("drag", "added_mass", "bend_weft", "bend_bias")  # Of a fabric's numbers.


@typed
@dataclasses.dataclass(frozen=True)
class Fabric:
    """What a sheet is made of; the defaults are a woven tablecloth.

    Attributes:
        stretch_stiffness: force per width and strain [N/m].
        shear: stiffness along the mesh's diagonals as a share of that along its other edges.
        bend_stiffness: moment per width and curvature [N m].
        bend_weft: of a sheet that bends as a plate the same along Y, where `bend_stiffness` is
            along X, of the sheet when it is built; a grid also stretches by what it says then. 0
            for one whose edges resist alike: that is what the tasks' cloth does, and it is stiffer
            than it says where it bends sharply, and stretches more easily by an eighth where it is
            soft.
        bend_bias: of a plate at 45 degrees between them; 0 for the mean of both.
        stretch_damping, bend_damping: dashpots as a multiple of the stiffness [s].
        density: mass of a unit of area [kg/m^2].
        thickness: that layers keep; on the floor, vertices are half as high [m].
        friction: on the floor.
        layer_friction: between layers.
        drag: coefficient of the air's drag on what moves along its normal; 0 is without air.
        added_mass: air that it takes along when it moves along its normal [kg/m^2]; of a strip of
            width w in the open pi/4 w 1.2 kg/m^3. It needs time: folds are slow in it.

    Raises:
        InvalidArgumentError: unless all are finite and above 0, or 0 where that is allowed.
    """

    # A tenth of the real one, about what a sheet so light can have in substeps of 0.4 ms. Strain
    # stays below 3 % at 0.6 m/s.
    stretch_stiffness: float = 400.0
    shear: float = 0.3  # Real ones are ten times less; folds keep their shape too badly at 3 cm.
    bend_stiffness: float = BEND_STIFFNESS
    stretch_damping: float = 1e-3
    bend_damping: float = 0.05
    density: float = AREA_DENSITY
    thickness: float = THICKNESS
    # SoftGym has 0.75 and freezes what is slower than 2 cm/s; with 0.75 alone some piles spread by
    # a fifth in 8 s of doing nothing.
    friction: float = 1.0
    layer_friction: float = 0.75
    drag: float = 1.2  # Of a plate across the flow.
    added_mass: float = 0.0
    bend_weft: float = 0.0
    bend_bias: float = 0.0

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if not (value > 0.0 or (name in _MAY_BE_NONE and value == 0.0)):
                raise InvalidArgumentError(name, value, "finite and above 0")

    @classmethod
    def named(
        cls, name: str, *, anisotropic: bool = False, measured_shear: bool = False
    ) -> "Fabric":
        """A fabric that others measured, as far as a sheet can be made of it.

        It bends as a plate: a strip of it hangs as one of the fabric does, whatever its mesh
        (`softgym-mj validate lab`). Stretch is the mean of both directions. Dampings and thickness
        are those of the default, and so is `shear`: what is published is softer than a mesh of 3 cm
        can follow, and folds keep their shape badly with it.

        Args:
            name: of `softgym_mj.cloth.fabrics.FABRICS`.
            anisotropic: whether it bends along warp (X of the sheet when it is built), bias and
                weft as was measured; else alike, by the mean of these.
            measured_shear: whether `shear` is such that the sheet resists shear as was measured, as
                far as that goes.

        Raises:
            InvalidArgumentError: if there is none of this name.
        """
        data = fabrics.named(name)
        warp, bias, weft = data.bending if anisotropic else (data.mean_bending,) * 3
        shear = min(max(_SHEAR * data.shear / data.mean_stretch, _LEAST_SHEAR), 1.0)
        return cls(
            stretch_stiffness=data.mean_stretch,
            shear=shear if measured_shear else cls.shear,
            bend_stiffness=warp,
            bend_weft=weft,
            bend_bias=bias,
            density=data.density,
            friction=data.friction,
            layer_friction=data.layer_friction,
            drag=data.drag,
            added_mass=data.added_mass,
        )

    def bent(self, stiffness: float) -> "Fabric":
        """The same one with another `bend_stiffness` [N m], and those of a plate in proportion."""
        factor = stiffness / self.bend_stiffness
        return dataclasses.replace(
            self,
            bend_stiffness=stiffness,
            bend_weft=factor * self.bend_weft,
            bend_bias=factor * self.bend_bias,
        )

    def material(self) -> dict[str, float]:
        """What the solver is told of it, by the names of `solver.Material`."""
        return solver_material(dataclasses.asdict(self))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Domain parameters of a sheet that is made of it."""
        return (
            scaled(
                "stretch_stiffness", "N/m", self.stretch_stiffness, 1.4, 2.0,
                "force per width and strain",
            ),
            scaled("shear", "", self.shear, 1.4, 2.0, "stiffness of diagonals to that of edges"),
            scaled(
                "bend_stiffness", "N m", self.bend_stiffness, 2.0, 5.0,
                "moment per width and curvature",
            ),
            _of_plates("bend_weft", self.bend_weft, "the same along Y; 0 is alike"),
            _of_plates("bend_bias", self.bend_bias, "the same at 45 degrees; 0 is their mean"),
            scaled("stretch_damping", "s", self.stretch_damping, 2.0, 5.0, "dashpot to stiffness"),
            scaled("bend_damping", "s", self.bend_damping, 2.0, 5.0, "dashpot to stiffness"),
            scaled("density", "kg/m^2", self.density, 1.4, 2.0, "mass of a unit of area"),
            scaled("thickness", "m", self.thickness, 1.2, 1.6, "that layers keep"),
            scaled("friction", "", self.friction, 1.2, 1.6, "on the floor"),
            scaled("layer_friction", "", self.layer_friction, 1.2, 1.6, "between layers"),
            Parameter(
                "drag", "", self.drag, (0.5 * self.drag, 1.5 * self.drag),
                (0.0, 2.0 * self.drag), "of the air on what moves along its normal",
            ),
            Parameter(
                "added_mass", "kg/m^2", self.added_mass, (0.0, max(self.added_mass, 0.1)),
                (0.0, max(2.0 * self.added_mass, 0.5)), "air taken along",
            ),
            shifted("hue", "deg", 20.0, 90.0, "by which colours are turned", "visual"),
            Parameter(
                "brightness", "", 1.0, (0.8, 1.0), (0.65, 1.0), "factor to colours", "visual"
            ),
            chosen("pattern", FABRICS, 3, "of the front, fainter on the back"),
        )  # fmt: skip


_MOST_BEND = 1e-3  # [N m] Stiffer than any fabric.


def _of_plates(name: str, nominal: float, summary: str) -> Parameter:
    """A stiffness that presets leave alone, unless the sheet is nominally a plate."""
    if nominal > 0.0:
        return scaled(name, "N m", nominal, 2.0, 5.0, summary)
    return Parameter(name, "N m", 0.0, (0.0, 0.0), (0.0, _MOST_BEND), summary)


def _told(shear: float) -> float:
    """What a grid has to be told of stretch for what it is to show, as a factor.

    Its lines are springs of stretch / 1.2 a width. Of a cell its diagonal adds shear / 4 of that to
    what it resists along the lines, and as much to what it pulls across them; a strip is free to
    get narrower.
    """
    along, across = 1.0 + shear / 4.0, shear / 4.0
    return 1.2 / (along - across**2 / along)


def solver_material(values: Mapping[str, float]) -> dict[str, float]:
    """The attributes of `solver.Material`, by name, for those of a `Fabric`, by name."""
    stretch = values["stretch_stiffness"]
    if values["bend_weft"] > 0.0:
        stretch *= _told(values["shear"])
    return {
        "stretch": stretch,
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
