"""Experiments of the lab: fabrics against theory, files, refusals. Cantilevers: test_plates.py."""

import csv
import dataclasses
import json
import math

import numpy as np
import pytest

from softgym_mj.entities.fabric import Fabric
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.reality.lab import experiments
from softgym_mj.reality.lab.meshes import MESHES, strip
from softgym_mj.reality.lab.report import run
from softgym_mj.reality.lab.specimen import Specimen
from tests.command import invoked, output_of

NAMES = ("navy_sparkle", "royal_target")  # The softest and the stiffest to be stretched.
FABRICS = pytest.mark.parametrize("name", NAMES)


@FABRICS
def test_a_hanging_strip_stretches_by_half_its_weight_over_its_stiffness(name):
    found = experiments.hanging(Fabric.named(name), name)
    density, stretch = {"navy_sparkle": (0.224, 16.0), "royal_target": (0.22, 4051.5)}[name]
    assert found.expected == pytest.approx(density * 9.81 * 0.36 / (2 * stretch))
    assert found.value == pytest.approx(found.expected, rel=0.02)


def test_in_substeps_of_tasks_a_woven_stretches_more():
    found = experiments.hanging(Fabric.named("royal_target"), "royal_target", is_fine=False)
    assert found.experiment == "hanging_sheet"
    assert 1.0 < found.error < 4.0
    assert not found.passed


@FABRICS
def test_a_sheet_falls_at_its_terminal_speed(name):
    found = experiments.falling(Fabric.named(name), name)
    assert found.value == pytest.approx(math.sqrt(2 * 0.222 * 9.81 / (1.2 * 1.2)), rel=0.02)


@FABRICS
def test_a_strip_swings_as_a_plate_in_the_air(name):
    found = experiments.swinging(Fabric.named(name), name)
    assert found.value < 0.2  # The air has damped most of half a radian.
    assert found.value == pytest.approx(found.expected, rel=0.03)


@pytest.mark.parametrize("friction", [0.2, 0.7])
def test_slopes_hold_and_slow_down_by_friction(friction):
    fabric = dataclasses.replace(Fabric.named("white_dots"), friction=friction)
    assert experiments.tilting(fabric, "rough").value == pytest.approx(friction, rel=0.01)
    assert experiments.sliding(fabric, "rough").value == pytest.approx(friction, rel=0.01)


@pytest.mark.parametrize("mesh", MESHES)
def test_strips_are_flat_whole_and_weigh_by_area(mesh):
    points, triangles = strip(mesh, 9, 6, 0.02)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert (normals > 0).all()
    length, width, height = np.ptp(points, axis=0)
    assert height == 0.0
    assert normals.sum() / 2 == pytest.approx(length * width)  # No hole and no overlap.
    specimen = Specimen(points, triangles, Fabric())
    mass = specimen.model.body_mass.sum()
    specimen.weigh_by_area()
    own = specimen.model.body_mass[specimen.model.flex_vertbodyid]
    assert mass == pytest.approx(0.128 * length * width) == pytest.approx(own.sum())
    # A vertex weighs what is nearest to it: as counted on a fine raster.
    x, y = np.meshgrid(*(np.linspace(0, 1, 301)[:-1] + 1 / 600 for _ in range(2)))
    places = np.column_stack([x.ravel() * length, (y.ravel() - 0.5) * width])
    nearest = np.argmin(((places[:, None] - points[None, :, :2]) ** 2).sum(axis=2), axis=1)
    counts = np.bincount(nearest, minlength=len(points)) / len(places)
    atol = 0.03 / len(points) if mesh != "unstructured" else 0.35 / len(points)
    np.testing.assert_allclose(own / own.sum(), counts, atol=atol)


def test_the_command_prints_and_writes_what_was_measured(tmp_path):
    arguments = ["validate", "lab", "--fabric", "red_jet_set", "--out", str(tmp_path)]
    arguments += ["--experiment", "falling", "--experiment", "sliding"]
    result = output_of(*arguments)
    assert "falling grid_0" in result and "2 of 2 within their bounds" in result
    rows = json.loads((tmp_path / "lab.json").read_text())["measurements"]
    assert [row["experiment"] for row in rows] == ["falling", "sliding"]
    assert rows[0]["error"] == pytest.approx(rows[0]["value"] / rows[0]["expected"] - 1, abs=1e-5)
    with (tmp_path / "lab.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(row["value"]) for row in table] == [row["value"] for row in rows]


def test_the_command_fails_if_a_number_is_off():
    options = ["--fabric", "white_dots", "--experiment", "hanging_sheet"]
    result = invoked("validate", "lab", *options)
    assert result.exit_code == 1
    assert "5 FAILED" in result.output


def test_unknown_fabrics_and_experiments_are_named():
    with pytest.raises(InvalidArgumentError, match=r"fabric='silk' is unknown.*'white_dots'"):
        run(["silk"])
    with pytest.raises(InvalidArgumentError, match=r"experiment='burning' is unknown.*'falling'"):
        run(["white_dots"], ["burning"])
    with pytest.raises(InvalidArgumentError, match=r"drag=0\.0"):
        experiments.falling(Fabric.named("flex_nominal"), "flex_nominal")
    with pytest.raises(InvalidArgumentError, match="cells=2"):
        experiments.cantilever(Fabric.named("white_dots"), "white_dots", cells=2)
