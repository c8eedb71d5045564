"""Sheets that bend as plates: cantilevers against the elastica, whatever the mesh; directions."""

import dataclasses

import numpy as np
import pytest

from softgym_mj.cloth import solver
from softgym_mj.entities.cloth import Cloth
from softgym_mj.entities.fabric import Fabric
from softgym_mj.reality.lab.experiments import SPACING, cantilever
from softgym_mj.reality.lab.meshes import MESHES, strip
from softgym_mj.reality.lab.specimen import Specimen

LOADS = (0.5, 5.0, 50.0)


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("load", LOADS)
def test_a_strip_of_a_named_fabric_hangs_as_the_fabric_does(mesh, load):
    fabric = Fabric.named("gray_interlock", measured_shear=True)
    found = cantilever(fabric, "gray_interlock", mesh, 8, load)
    assert found.value == pytest.approx(5.2e-6, rel=0.1)  # (5.8 + 6.2 + 3.6) / 3 uN m


@pytest.mark.parametrize("load", LOADS)
def test_so_does_one_with_the_spacing_of_sheets_and_the_time_steps_of_tasks(load):
    fabric = Fabric.named("black_denim")
    found = cantilever(fabric, "black_denim", "grid_0", 8, load, SPACING)
    assert found.value == pytest.approx(1.95e-5, rel=0.05)


def test_edges_that_resist_alike_are_stiffer_than_they_say_where_they_bend_sharply():
    """Shows the error of equal hinges, which plates avoid."""
    alike = dataclasses.replace(Fabric.named("black_denim"), bend_weft=0.0, bend_bias=0.0)
    found = cantilever(alike, "alike", "grid_0", 8, 50.0, SPACING)
    assert 1.35 < found.value / found.expected < 1.5


@pytest.mark.parametrize("mesh", ["grid_0", "grid_90"])
def test_a_strip_along_x_bends_by_the_warp(mesh):
    fabric = dataclasses.replace(Fabric(), bend_stiffness=3e-5, bend_weft=1e-5, bend_bias=2e-5)
    found = cantilever(fabric, "two", mesh, 8, 2.0, SPACING)
    assert found.value == pytest.approx(3e-5, rel=0.05)


def sag(points: np.ndarray, triangles: np.ndarray, fabric: Fabric) -> float:
    """Drop [m] of the end of a strip along X or Y, under little weight."""
    along = int(np.ptp(points[:, 1]) > np.ptp(points[:, 0]))
    specimen = Specimen(points, triangles, fabric, gravity=(0.0, 0.0, -0.004))
    specimen.weigh_by_area()
    specimen.hold(np.flatnonzero(points[:, along] <= 2 * SPACING + 1e-9))
    specimen.settle()
    end = points[:, along] >= points[:, along].max() - 1e-9
    return -float(specimen.positions()[end, 2].mean())


def test_a_strip_along_y_bends_by_the_weft():
    fabric = dataclasses.replace(Fabric(), bend_stiffness=3e-5, bend_weft=1e-5, drag=0.0)
    points, triangles = strip("grid_0", 8, 4, SPACING)
    turned = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    turned = turned - [turned[:, 0].mean(), 0.0, 0.0]
    ratio = sag(turned, triangles, fabric) / sag(points, triangles, fabric)
    assert ratio == pytest.approx(3.0, rel=0.03)


def test_a_strip_at_45_degrees_bends_by_the_bias():
    softer = dataclasses.replace(
        Fabric(), bend_stiffness=1e-5, bend_weft=1e-5, bend_bias=0.7e-5, drag=0.0, shear=1e-3
    )
    even = dataclasses.replace(softer, bend_bias=1e-5)
    points, triangles = strip("grid_45", 9, 8, SPACING)
    ratio = sag(points, triangles, softer) / sag(points, triangles, even)
    assert ratio == pytest.approx(1 / 0.7, rel=0.06)


def keys(cloth):
    """Names of the attributes of the plugin in a model."""
    return {config.key for config in cloth.mjcf_model.extension.plugin[0].instance[0].config}


def test_only_plates_and_sheets_that_stiffen_say_so_in_their_model():
    """Models without them are what they were before there were any."""
    for fabric, expected in (
        (Fabric(), set()),
        (Fabric.named("red_jet_set"), {"bend_weft"}),
        (Fabric(stiffening=20.0), {"stiffening"}),
    ):
        assert keys(Cloth(fabric=fabric)) & {"bend_weft", "stiffening"} == expected


def test_a_plate_is_taken_back():
    cloth = Cloth(fabric=Fabric.named("red_jet_set"))
    values = {p.name: p.nominal for p in Fabric().parameters}
    assert cloth.adjust(values)
    assert not keys(cloth) & {"bend_weft", "bend_bias"}


def test_a_plate_floats_without_gaining_energy():
    """Second differences push nothing on the whole: momentum stays."""
    fabric = dataclasses.replace(Fabric.named("royal_target"), drag=0.0)
    points, triangles = strip("unstructured", 8, 8, SPACING)
    specimen = Specimen(points, triangles, fabric, gravity=(0.0, 0.0, 0.0))
    noise = np.random.default_rng(0).normal(0.0, 0.3, points.shape)
    specimen.place(specimen.start, noise)
    mass = specimen.model.body_mass[specimen.model.flex_vertbodyid][:, None]
    energies = []
    for _ in range(50):
        specimen.step()
        energies.append(float((mass * specimen.velocities() ** 2).sum()) / 2.0)
    assert max(energies) < float((mass * noise**2).sum()) / 2.0
    drift = (mass * (specimen.velocities() - noise)).sum(axis=0)
    assert np.abs(drift).max() < 1e-5 * float(np.abs(mass * noise).sum())


def test_materials_name_every_attribute():
    names = {field.name for field in dataclasses.fields(solver.Material)}
    assert set(Fabric().material()) <= names
