"""Unknown parameters: ratios to the density, since only these affect cloth with given hand motions.

With position-controlled grippers, a sheet of twice the mass, stiffness and drag moves identically.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError

# [m] Thickness of real cloth, a fixed parameter. With that of `Fabric()`, folds of two layers are 2
# cm high, and finer meshes, whose layers cannot be so thick, would move differently.
THICKNESS = 0.0025
# Share of the density: start of a search if a fabric has no added mass, whose logarithm is
# undefined. About a third of that of an open strip of 0.5 m with 0.2 kg/m^2.
_FIRST_ADDED_MASS = 0.7


@dataclasses.dataclass(frozen=True)
class Unknown:
    """Unknown parameter.

    Attributes:
        name, unit: of the parameter.
        summary: description.
        low, high: bounds of the search.
        scale: initial spread of searches, in the natural logarithm or in the value itself.
        is_logarithmic: whether searches use its logarithm.
        is_only_bounded: whether only the lower end of its interval is meaningful.
    """

    name: str
    unit: str
    summary: str
    low: float
    high: float
    scale: float
    is_logarithmic: bool = True
    is_only_bounded: bool = False

    def coordinate(self, value: float) -> float:
        """Returns the coordinate of a value."""
        return (math.log(value) if self.is_logarithmic else value) / self.scale

    def value(self, coordinate: float) -> float:
        """Returns the value of a coordinate."""
        seen = coordinate * self.scale
        return math.exp(seen) if self.is_logarithmic else seen


LATENCY = "latency"
UNKNOWNS = (
    # Gravity bending lengths of 5 to 45 mm: wider than those of 618 fabrics (Feng et al., 2022).
    Unknown("bending", "m^4/s^2", "bending stiffness B / density", 1.2e-6, 9e-4, 0.8),
    Unknown("drag", "m^2/kg", "drag coefficient C_d / density", 0.3, 60.0, 0.6),
    Unknown("added_mass", "", "air taken along / density", 0.02, 10.0, 0.8),
    Unknown("friction", "", "friction on the floor", 0.05, 2.0, 0.5),
    Unknown("layer_friction", "", "friction between layers", 0.05, 2.0, 0.5),
    # Upper limit of the substeps. A rag's sag under its own weight, rho g L^2 / 2 k, is a
    # millimeter or two, below the uncertainty of its length and of the camera's position.
    Unknown("stretch", "m^2/s^2", "stretch stiffness / density", 300.0, 1e4, 0.8, True, True),
    Unknown(LATENCY, "s", "time of a frame - that of what it shows", -1.0, 1.0, 0.03, False),
)
NAMES = tuple(unknown.name for unknown in UNKNOWNS)


def values_of(fabric: Fabric, latency: float) -> dict[str, float]:
    """Returns the parameters of a fabric and a latency [s] by name, clipped to the bounds."""
    rho = fabric.density
    found = {
        "bending": fabric.bend_stiffness / rho,
        "drag": fabric.drag / rho,
        "added_mass": fabric.added_mass / rho or _FIRST_ADDED_MASS,
        "friction": fabric.friction,
        "layer_friction": fabric.layer_friction,
        "stretch": fabric.stretch_stiffness / rho,
        LATENCY: latency,
    }
    return {u.name: min(max(found[u.name], u.low), u.high) for u in UNKNOWNS}


def fabric_of(values: Mapping[str, float], base: Fabric) -> Fabric:
    """Returns a fabric with parameters by name; density and fixed ones are those of `base`."""
    rho = base.density
    return dataclasses.replace(
        base.bent(values["bending"] * rho),
        drag=values["drag"] * rho,
        added_mass=values["added_mass"] * rho,
        friction=values["friction"],
        layer_friction=values["layer_friction"],
        stretch_stiffness=values["stretch"] * rho,
    )


def coordinates_of(values: Mapping[str, float]) -> np.ndarray:
    """Returns the coordinates (unknowns,) of parameters by name."""
    missing = [name for name in NAMES if name not in values]
    if missing:
        raise InvalidArgumentError("values", sorted(values), f"also {', '.join(missing)}")
    return np.array([unknown.coordinate(values[unknown.name]) for unknown in UNKNOWNS])


def values_at(coordinates: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Returns parameters by name at coordinates (unknowns,)."""
    return {u.name: u.value(float(x)) for u, x in zip(UNKNOWNS, coordinates, strict=True)}


def bounds(latency: float, reach: float) -> np.ndarray:
    """Returns search bounds (unknowns, 2), with latencies within `reach` of `latency` [s]."""
    rows = []
    for unknown in UNKNOWNS:
        low, high = unknown.low, unknown.high
        if unknown.name == LATENCY:
            low, high = max(low, latency - reach), min(high, latency + reach)
        rows.append([unknown.coordinate(low), unknown.coordinate(high)])
    return np.array(rows)
