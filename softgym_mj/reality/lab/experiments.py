"""What is done to sheets in the lab: each gives what was measured and what theory says."""

import dataclasses
import math

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.lab import theory
from softgym_mj.reality.lab.meshes import strip
from softgym_mj.reality.lab.specimen import Specimen

# Greatest share by which a measured number may be off, by experiment.
BOUNDS = {"cantilever": 0.10, "hanging": 0.05, "falling": 0.05, "tilting": 0.02, "sliding": 0.02}

_WIDTH = 4  # Cells across a strip.
_FLAT = 1e-2  # [N m] Bending stiffness with which a small sheet stays flat.


@dataclasses.dataclass(frozen=True)
class Measurement:
    """A number that was measured.

    Attributes:
        experiment: one of `BOUNDS`.
        fabric: name of what the sheet was made of.
        mesh: one of `meshes.MESHES`.
        quantity: what was measured, with its unit.
        value: of it.
        expected: by theory.
        settings: the numbers of the experiment, by name, with units in the names.
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
        """By which share of what is expected it is off."""
        return self.value / self.expected - 1.0

    @property
    def bound(self) -> float:
        """By which share it may be off."""
        return BOUNDS[self.experiment]

    @property
    def passed(self) -> bool:
        """Whether it is within the bound."""
        return abs(self.error) <= self.bound


def cantilever(
    fabric: Fabric,
    name: str,
    mesh: str = "grid_0",
    cells: int = 12,
    load: float = 5.0,
    spacing: float = 0.03,
    substeps: int = 25,
) -> Measurement:
    """A strip, clamped at one end, hangs under its weight: effective bending stiffness.

    That is the one of the elastica with the same drop over width. Weight is chosen such that the
    load, weight per area times length^3 over bending stiffness, is what is asked for.

    Args:
        fabric: what it is made of.
        name: of that.
        mesh: one of `meshes.MESHES`.
        cells: spacings that it is long, 3 or more.
        load: 0.01..5000.
        spacing: between vertices [m].
        substeps: of a step of 10 ms.
    """
    if cells < 3:
        raise InvalidArgumentError("cells", cells, "3 or more")
    points, triangles = strip(mesh, cells + 1, _WIDTH, spacing)
    columns = np.unique(points[:, 0].round(9))
    clamped = columns[1] if mesh != "unstructured" else spacing
    # Half of what is clamped last bends, too: its hinges fold on both sides of it.
    clamp = (clamped + columns[0]) / 2.0
    length = columns[-1] - clamp
    gravity = load * fabric.bend_stiffness / (fabric.density * length**3)
    still = dataclasses.replace(fabric, drag=0.0)
    specimen = Specimen(points, triangles, still, gravity=(0.0, 0.0, -gravity), substeps=substeps)
    specimen.hold(np.flatnonzero(points[:, 0] <= clamped + 1e-9))
    specimen.settle()
    tip = points[:, 0] >= columns[-1] - 1e-9
    place = specimen.positions()[tip].mean(axis=0)
    found = load / theory.load_of(-place[2] / (place[0] - clamp))
    settings = {
        "cells": cells, "load": load, "spacing_m": spacing, "gravity_m_s2": gravity,
        "substeps": substeps, "steps": specimen.steps,
    }  # fmt: skip
    return Measurement(
        "cantilever", name, mesh, "bending stiffness [N m]", found * fabric.bend_stiffness,
        fabric.bend_stiffness, settings,
    )  # fmt: skip


def hanging(
    fabric: Fabric, name: str, cells: int = 12, spacing: float = 0.03, substeps: int = 25
) -> Measurement:
    """A strip hangs from its upper edge: mean strain under its own weight.

    Args:
        fabric, name, cells, spacing, substeps: as of `cantilever`.
    """
    points, triangles = strip("grid_0", cells, _WIDTH, spacing)
    still = dataclasses.replace(fabric, drag=0.0)
    down = (theory.GRAVITY, 0.0, 0.0)  # Along the strip: it lies as it would hang.
    specimen = Specimen(points, triangles, still, gravity=down, substeps=substeps)
    specimen.hold(np.flatnonzero(points[:, 0] <= 1e-9))
    specimen.settle()
    length = cells * spacing
    tip = points[:, 0] >= length - 1e-9
    strain = float((specimen.positions() - points)[tip, 0].mean()) / length
    expected = theory.hanging_strain(fabric.density, fabric.stretch_stiffness, length)
    settings = {"cells": cells, "spacing_m": spacing, "substeps": substeps}
    return Measurement("hanging", name, "grid_0", "mean strain", strain, expected, settings)


def falling(fabric: Fabric, name: str, spacing: float = 0.03) -> Measurement:
    """A small flat sheet falls along its normal: its speed after 3 s.

    It has a bending stiffness of 1e-2 N m, as a limp one does not stay flat.

    Args:
        fabric, name, spacing: as of `cantilever`; with drag.
    """
    if fabric.drag <= 0.0:
        raise InvalidArgumentError("drag", fabric.drag, "above 0, to fall at an even speed")
    points, triangles = strip("grid_0", 2, 2, spacing)
    flat = dataclasses.replace(fabric, bend_stiffness=_FLAT)
    specimen = Specimen(points, triangles, flat)
    specimen.step(300)
    speed = -float(specimen.velocities()[:, 2].mean())
    expected = theory.terminal_speed(fabric.density, fabric.drag)
    settings = {"drag": fabric.drag, "spacing_m": spacing}
    return Measurement("falling", name, "grid_0", "speed [m/s]", speed, expected, settings)


_TILT_SPEED = 0.05  # By which a slope's tangent grows in a second.
_SLIPPED = 1e-3  # [m] What has moved by this slides.


def tilting(fabric: Fabric, name: str, spacing: float = 0.03) -> Measurement:
    """A sheet on a floor that is tilted slowly: the slope at which it slips.

    Args:
        fabric, name, spacing: as of `cantilever`.
    """
    specimen = _lying(fabric, spacing)
    slope = 0.8 * fabric.friction
    while float((specimen.positions() - specimen.start)[:, 0].mean()) < _SLIPPED:
        slope += _TILT_SPEED * specimen.model.opt.timestep * fabric.friction
        if slope > 2.0 * fabric.friction:
            break
        _tilt(specimen, slope)
        specimen.step()
    settings = {"spacing_m": spacing}
    return Measurement(
        "tilting", name, "grid_0", "static friction", slope, fabric.friction, settings
    )


def sliding(
    fabric: Fabric, name: str, steepness: float = 1.3, spacing: float = 0.03
) -> Measurement:
    """A sheet slides down a slope for a second: friction, of the way that it gets.

    Args:
        fabric, name, spacing: as of `cantilever`.
        steepness: slope over friction, above 1.
    """
    specimen = _lying(dataclasses.replace(fabric, drag=0.0), spacing)
    slope = steepness * fabric.friction
    _tilt(specimen, slope)
    specimen.step(100)
    way = float((specimen.positions() - specimen.start)[:, 0].mean())
    angle = math.atan(slope)
    found = math.tan(angle) - 2.0 * way / (theory.GRAVITY * math.cos(angle))
    settings = {"steepness": steepness, "spacing_m": spacing}
    return Measurement(
        "sliding", name, "grid_0", "sliding friction", found, fabric.friction, settings
    )


def _lying(fabric: Fabric, spacing: float) -> Specimen:
    points, triangles = strip("grid_0", 7, 7, spacing)
    return Specimen(points + [0.0, 0.0, fabric.thickness / 2.0], triangles, fabric, floor=True)


def _tilt(specimen: Specimen, slope: float) -> None:
    """Turns gravity instead of the floor."""
    angle = math.atan(slope)
    specimen.model.opt.gravity[:] = [
        theory.GRAVITY * math.sin(angle), 0.0, -theory.GRAVITY * math.cos(angle)
    ]  # fmt: skip
