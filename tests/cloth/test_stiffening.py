"""Sheets that stiffen with strain: against the closed form of strips under load, and in a model."""

import dataclasses

import numpy as np
import pytest

from softgym_mj.cloth.fabrics import FABRICS, STRETCHED
from softgym_mj.entities import Fabric
from softgym_mj.reality.lab import theory
from softgym_mj.reality.lab.meshes import strip
from softgym_mj.reality.lab.specimen import Specimen

SPACING, CELLS, WIDTH = 0.03, 24, 8  # [m] Vertex spacing of the tasks; cells of strips.
LENGTH = CELLS * SPACING
KNITS = [name for name, fabric in FABRICS.items() if fabric.stretched]


def thin(fabric):
    """The fabric without air, too thin to touch itself."""
    return dataclasses.replace(fabric, drag=0.0, thickness=1e-3)


def hung(fabric, load):
    """Mean strain of a strip that hangs from its upper edge, with a load per width [N/m]."""
    points, triangles = strip("grid_0", CELLS, WIDTH, SPACING)
    specimen = Specimen(points, triangles, thin(fabric), gravity=(theory.GRAVITY, 0.0, 0.0))
    specimen.hold(np.flatnonzero(points[:, 0] <= 1e-9))
    end = np.flatnonzero(points[:, 0] >= LENGTH - 1e-9)
    widths = np.full(len(end), SPACING)
    widths[[points[end, 1].argmin(), points[end, 1].argmax()]] /= 2.0
    specimen.data.qfrc_applied[specimen.dofs[end][:, 0]] = load * widths
    specimen.settle()
    return float((specimen.positions() - points)[end, 0].mean()) / LENGTH


@pytest.mark.parametrize("name", KNITS)
def test_a_strip_under_load_stretches_by_the_closed_form(name):
    fabric = Fabric.named(name, measured_stiffening=True)
    for load in (0.0, 5.0, 20.0):
        expected = theory.hanging_strain(
            fabric.density, fabric.stretch_stiffness, LENGTH, fabric.stiffening, load
        )
        assert hung(fabric, load) == pytest.approx(expected, rel=0.03)


def test_it_stretches_less_than_a_linear_one():
    fabric = Fabric.named("gray_interlock")
    stiffening = Fabric.named("gray_interlock", measured_stiffening=True)
    assert fabric.stiffening == 0.0
    assert hung(stiffening, 20.0) < 0.2 * hung(fabric, 20.0)


def test_the_closed_form_is_the_mean_over_the_strip():
    density, stretch, length, stiffening, load = 0.2, 50.0, 0.7, 60.0, 4.0
    tensions = load + density * theory.GRAVITY * np.linspace(0.0, length, 20_001)
    strains = (np.sqrt(1.0 + 4.0 * stiffening * tensions / stretch) - 1.0) / (2.0 * stiffening)
    np.testing.assert_allclose(stretch * strains * (1.0 + stiffening * strains), tensions)
    found = theory.hanging_strain(density, stretch, length, stiffening, load)
    assert found == pytest.approx(strains.mean(), rel=1e-6)
    linear = theory.hanging_strain(density, stretch, length, 1e-7, load)
    assert linear == pytest.approx(theory.hanging_strain(density, stretch, length, 0.0, load), 1e-5)


def test_knits_have_the_published_force_at_a_strain_of_a_sixth():
    assert KNITS == ["gray_interlock", "ivory_rib_knit", "navy_sparkle", "camel_ponte"]
    # Of the T-shirt: 452.5 N/m times the Green strain of 0.1806 times the stretch of 1.1667.
    fabric = Fabric.named("gray_interlock", measured_stiffening=True)
    force = fabric.stretch_stiffness * STRETCHED * (1.0 + fabric.stiffening * STRETCHED)
    assert force == pytest.approx(452.5 * 0.18056 * 1.16667, rel=1e-4)
    assert Fabric.named("white_dots", measured_stiffening=True).stiffening == 0.0


@pytest.mark.parametrize("mesh", ["grid_0", "unstructured"])
def test_a_stretched_sheet_that_floats_gains_no_energy(mesh):
    fabric = dataclasses.replace(
        Fabric.named("gray_interlock", measured_stiffening=True), drag=0.0, thickness=1e-3
    )
    points, triangles = strip(mesh, 8, 8, SPACING)
    specimen = Specimen(points, triangles, fabric, gravity=(0.0, 0.0, 0.0))
    specimen.place(specimen.start * [1.2, 1.0, 1.0], np.zeros(points.shape))
    mass = specimen.model.body_mass[specimen.model.flex_vertbodyid][:, None]
    # Stored in the lines along X, per area: k e^2 / 2 + k s e^3 / 3.
    strain, area = 0.2, (8 * SPACING) ** 2
    k, s = fabric.stretch_stiffness, fabric.stiffening
    stored = area * k * strain**2 * (0.5 + s * strain / 3.0)
    energies = []
    for _ in range(100):
        specimen.step()
        energies.append(float((mass * specimen.velocities() ** 2).sum()) / 2.0)
    assert max(energies) < stored
    assert max(energies[-10:]) < 0.01 * stored
    momentum = (mass * specimen.velocities()).sum(axis=0)
    assert np.abs(momentum).max() < 2e-5 * np.sqrt(2.0 * stored * mass.sum())
