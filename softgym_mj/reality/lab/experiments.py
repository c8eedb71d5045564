"""Experiments with sheets: each returns a measured value and the theoretical one."""

import dataclasses
import math

import numpy as np

from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError, SimulationError
from softgym_mj.reality.lab import theory
from softgym_mj.reality.lab.meshes import strip
from softgym_mj.reality.lab.specimen import Specimen
from softgym_mj.reality.lab.timing import USUAL, converged

# Largest relative error of each experiment.
BOUNDS = {
    "cantilever": 0.10, "cantilever_sheet": 0.10, "hanging": 0.05, "hanging_sheet": 0.05,
    "falling": 0.05, "swinging": 0.05, "tilting": 0.02, "sliding": 0.02,
}  # fmt: skip
SPACING = 0.03  # [m] Vertex spacing of sheets.

_WIDTH = 8  # Cells across a strip,
_CLAMPED = 2  # and approximate number of clamped cells.
_THIN = 0.05  # Thickness of hanging sheets relative to the spacing.
_FLAT = 1e-2  # [N m] Bending stiffness with which a small sheet stays flat.


def _loose(fabric: Fabric, spacing: float) -> Fabric:
    """Returns a fabric without air and so thin that a hanging sheet never touches itself."""
    return dataclasses.replace(fabric, drag=0.0, thickness=_THIN * spacing)


def _stiff(fabric: Fabric) -> Fabric:
    """Returns a fabric of which a small sheet stays flat."""
    return dataclasses.replace(fabric, bend_stiffness=_FLAT, bend_weft=0.0, bend_bias=0.0)


def _period(fabric: Fabric, length: float) -> float:
    """Returns the period [s] of the slowest oscillation of a cantilever of a length [m]."""
    return 1.79 * length**2 * math.sqrt(fabric.density / fabric.bend_stiffness)


@dataclasses.dataclass(frozen=True)
class Measurement:
    """Measured number.

    Attributes:
        experiment: one of `BOUNDS`.
        fabric: name of the fabric.
        mesh: one of `meshes.MESHES`.
        quantity: measured quantity, with its unit.
        value: measured value.
        expected: theoretical value.
        settings: parameters of the experiment by name, with units in the names.
    """

    experiment: str
    fabric: str
    mesh: str
    quantity: str
    value: float
    expected: float
    settings: dict[str, float]

    @property
    def error(self) -> float:
        """Relative error."""
        return self.value / self.expected - 1.0

    @property
    def bound(self) -> float:
        """Largest allowed relative error."""
        return BOUNDS[self.experiment]

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound."""
        return abs(self.error) <= self.bound


def cantilever(
    fabric: Fabric,
    name: str,
    mesh: str = "grid_0",
    cells: int = 12,
    load: float = 5.0,
    spacing: float | None = None,
) -> Measurement:
    """Measures the effective bending stiffness of a clamped strip that hangs under its weight.

    It is that of the elastica with the same drop over width. The load is weight per area times
    length^3 over bending stiffness.

    Args:
        fabric: the fabric.
        name: name of the fabric.
        mesh: one of `meshes.MESHES`.
        cells: length of the strip in spacings, 3 or more.
        load: 0.02..500.
        spacing: vertex spacing [m]; gravity is adjusted to the load, and time steps are those of
            tasks. None for the length that has this load under Earth's gravity, and for substeps so
            fine that the solver converges.
    """
    if cells < 3:
        raise InvalidArgumentError("cells", cells, "3 or more")
    timing = USUAL
    if spacing is None:
        size = (fabric.bend_stiffness / (fabric.density * theory.GRAVITY)) ** (1.0 / 3.0)
        spacing = size * load ** (1.0 / 3.0) / (cells + 0.5)
        timing = converged(fabric, spacing, _period(fabric, size * load ** (1.0 / 3.0)))
        experiment = "cantilever"
    else:
        experiment = "cantilever_sheet"
    points, triangles = strip(mesh, cells + _CLAMPED, _WIDTH, spacing)
    rows = np.unique(points[:, 0].round(9))
    rows = rows[rows <= _CLAMPED * spacing + 1e-9]
    # Half of the last clamped cell bends, too: hinges fold at the last row that is held.
    clamp = (rows[-1] + rows[-2]) / 2.0
    length = points[:, 0].max() - clamp
    gravity = load * fabric.bend_stiffness / (fabric.density * length**3)
    specimen = Specimen(
        points, triangles, timing.applied(_loose(fabric, spacing)),
        gravity=(0.0, 0.0, -gravity), substeps=timing.substeps, timestep=timing.timestep,
    )  # fmt: skip
    specimen.weigh_by_area()
    specimen.hold(np.flatnonzero(points[:, 0] <= rows[-1] + 1e-9))
    specimen.settle()
    tip = points[:, 0] >= points[:, 0].max() - 1e-9
    place = specimen.positions()[tip].mean(axis=0)
    found = load / theory.load_of(-place[2] / (place[0] - clamp))
    settings = {
        "cells": cells, "load": load, "spacing_m": spacing, "gravity_m_s2": gravity,
        "substep_s": timing.substep, "steps": specimen.steps,
    }  # fmt: skip
    return Measurement(
        experiment, name, mesh, "bending stiffness [N m]", found * fabric.bend_stiffness,
        fabric.bend_stiffness, settings,
    )  # fmt: skip


def hanging(fabric: Fabric, name: str, cells: int = 12, is_fine: bool = True) -> Measurement:
    """Measures the mean strain of a strip that hangs from its upper edge under its own weight.

    Args:
        fabric, name, cells: as in `cantilever`.
        is_fine: whether substeps are so fine that the solver converges; else those of tasks.
    """
    points, triangles = strip("grid_0", cells, _WIDTH, SPACING)
    timing = converged(fabric, SPACING) if is_fine else USUAL
    down = (theory.GRAVITY, 0.0, 0.0)  # Gravity acts along the strip, which lies flat.
    specimen = Specimen(
        points, triangles, timing.applied(_loose(fabric, SPACING)),
        gravity=down, substeps=timing.substeps, timestep=timing.timestep,
    )  # fmt: skip
    specimen.hold(np.flatnonzero(points[:, 0] <= 1e-9))
    specimen.settle()
    length = cells * SPACING
    tip = points[:, 0] >= length - 1e-9
    strain = float((specimen.positions() - points)[tip, 0].mean()) / length
    expected = theory.hanging_strain(fabric.density, fabric.stretch_stiffness, length)
    settings = {"cells": cells, "spacing_m": SPACING, "substep_s": timing.substep}
    experiment = "hanging" if is_fine else "hanging_sheet"
    return Measurement(experiment, name, "grid_0", "mean strain", strain, expected, settings)


def falling(fabric: Fabric, name: str) -> Measurement:
    """Measures the speed of a small flat sheet that falls along its normal for 3 s.

    Its bending stiffness is 1e-2 N m, because a limp sheet does not stay flat.

    Args:
        fabric, name: as in `cantilever`; with drag.
    """
    if fabric.drag <= 0.0:
        raise InvalidArgumentError("drag", fabric.drag, "above 0, for a terminal speed")
    specimen = Specimen(*strip("grid_0", 2, 2, SPACING), _stiff(fabric))
    specimen.step(300)
    speed = -float(specimen.velocities()[:, 2].mean())
    expected = theory.terminal_speed(fabric.density, fabric.drag)
    settings = {"drag": fabric.drag, "spacing_m": SPACING}
    return Measurement("falling", name, "grid_0", "speed [m/s]", speed, expected, settings)


_SWINGS = 6  # Half swings.
_AMPLITUDE = 0.5  # [rad] Initial amplitude.


def swinging(fabric: Fabric, name: str, cells: int = 6) -> Measurement:
    """Measures the amplitude of a strip that swings in the air from one edge, after three swings.

    It is compared with the equation of a rigid plate in the same air. Its bending stiffness is 1e-2
    N m, because a limp strip does not stay flat.

    Args:
        fabric, name, cells: as in `cantilever`; with drag.
    """
    if fabric.drag <= 0.0:
        raise InvalidArgumentError("drag", fabric.drag, "above 0, for a decaying swing")
    points, triangles = strip("grid_0", cells, 2, SPACING)
    specimen = Specimen(points, triangles, _stiff(fabric))
    specimen.weigh_by_area()
    specimen.hold(np.flatnonzero(points[:, 0] <= 1e-9))
    start = np.column_stack(
        [points[:, 0] * math.sin(_AMPLITUDE), points[:, 1], -points[:, 0] * math.cos(_AMPLITUDE)]
    )
    specimen.place(start)
    tip = points[:, 0] >= cells * SPACING - 1e-9
    angles = [_AMPLITUDE]
    expected = theory.swing_amplitude(
        fabric.density, fabric.drag, cells * SPACING, _AMPLITUDE, _SWINGS
    )
    peaks: list[float] = []
    while len(peaks) < _SWINGS:
        specimen.step()
        place = specimen.positions()[tip].mean(axis=0)
        angles.append(math.atan2(place[0], -place[2]))
        if len(angles) > 2 and (angles[-2] - angles[-3]) * (angles[-1] - angles[-2]) <= 0.0:
            peaks.append(_peak(angles[-3:]))
        if len(angles) > _MOST_ANGLES:
            raise SimulationError(f"a strip of {name} does not swing")
    settings = {"drag": fabric.drag, "spacing_m": SPACING, "cells": cells, "half_swings": _SWINGS}
    return Measurement(
        "swinging", name, "grid_0", "amplitude [rad]", abs(peaks[-1]), expected, settings
    )


_MOST_ANGLES = 2000


def _peak(angles: list[float]) -> float:
    """Returns the maximum of the parabola through three angles [rad]."""
    before, middle, after = angles
    bend = before - 2.0 * middle + after
    return middle if bend == 0.0 else middle - (after - before) ** 2 / (8.0 * bend)


_TILT_SPEED = 0.02  # [1/s] Rate of the slope's tangent.
_STEEPNESS = 1.3  # Slope over friction where a sheet slides.
_SLIPPED = 1e-4  # [m] Displacement from which a sheet counts as sliding.


def tilting(fabric: Fabric, name: str) -> Measurement:
    """Measures the slope at which a sheet of a named fabric slips on a slowly tilted floor."""
    specimen = _lying(fabric)
    slope = 0.9 * fabric.friction
    while float((specimen.positions() - specimen.start)[:, 0].mean()) < _SLIPPED:
        slope += _TILT_SPEED * specimen.model.opt.timestep * fabric.friction
        if slope > 2.0 * fabric.friction:
            break
        _tilt(specimen, slope)
        specimen.step()
    settings = {"spacing_m": SPACING}
    return Measurement(
        "tilting", name, "grid_0", "static friction", slope, fabric.friction, settings
    )


def sliding(fabric: Fabric, name: str) -> Measurement:
    """Measures a named fabric's friction by how far a sheet slides down a slope in a second."""
    specimen = _lying(dataclasses.replace(fabric, drag=0.0))
    slope = _STEEPNESS * fabric.friction
    _tilt(specimen, slope)
    specimen.step(100)
    way = float((specimen.positions() - specimen.start)[:, 0].mean())
    angle = math.atan(slope)
    found = math.tan(angle) - 2.0 * way / (theory.GRAVITY * math.cos(angle))
    settings = {"steepness": _STEEPNESS, "spacing_m": SPACING}
    return Measurement(
        "sliding", name, "grid_0", "sliding friction", found, fabric.friction, settings
    )


def _lying(fabric: Fabric) -> Specimen:
    points, triangles = strip("grid_0", 7, 7, SPACING)
    return Specimen(points + [0.0, 0.0, fabric.thickness / 2.0], triangles, fabric, floor=True)


def _tilt(specimen: Specimen, slope: float) -> None:
    """Tilts gravity instead of the floor."""
    angle = math.atan(slope)
    specimen.model.opt.gravity[:] = [
        theory.GRAVITY * math.sin(angle), 0.0, -theory.GRAVITY * math.cos(angle)
    ]  # fmt: skip
