"""Identification from garments: what was simulated with known numbers, read by the command."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.exceptions import StoreError
from softgym_mj.reality.garment_windows import WINDOWS
from softgym_mj.reality.identification import garment_data
from softgym_mj.reality.identification.recordings import FIT, HELD_OUT
from tests.reality.captures import FABRIC, write_capture, write_obj

CAPTURES = tuple(name for name in WINDOWS if name.startswith("green_tshirt_grasp"))[:3]
SECRET = dataclasses.replace(FABRIC.bent(8.0 * FABRIC.bend_stiffness), friction=0.5)
LATE = 0.04  # [s]
SIDE = (16, 0)  # Vertices that hands take: pulled by a diagonal, it folds in one of several ways.


@pytest.fixture(name="data", scope="module")
def _data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("garments")
    write_obj(folder / "meshes" / "Green_Tshirt" / "green_tshirt_10k.obj")
    for name in CAPTURES:
        frames = WINDOWS[name].begin + np.arange(0.1, 1.5, 0.1)
        write_capture(folder, name, frames, fabric=SECRET, late=LATE, taken=SIDE)
    return folder


def test_the_third_capture_is_held_out_and_the_truth_fits_best(data):
    scenes, found = garment_data.read_garments(data, "green_tshirt")
    assert [(r.name, r.role) for r in found] == list(
        zip(CAPTURES, [FIT, FIT, HELD_OUT], strict=True)
    )
    first = found[0]
    np.testing.assert_allclose(
        first.times, WINDOWS[first.name].begin + np.arange(0.1, 1.5, 0.1), atol=1e-6
    )
    scene = scenes[first.scene]
    true, other = (scene.motion(fabric) for fabric in (SECRET, FABRIC))
    least = first.distances(true, LATE).mean()
    assert least < 5e-5
    assert first.distances(other, LATE).mean() > 2e-3
    assert first.distances(true, 0.0).mean() > 2e-3


@pytest.mark.long
def test_the_command_says_what_it_found_and_goes_on(data, tmp_path):
    arguments = [
        "identify", "garments", str(data), "--garment", "green_tshirt", "--seeds", "1",
        "--evaluations", "160", "--out", str(tmp_path),
    ]  # fmt: skip
    result = CliRunner().invoke(commands.app, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "identification.json").read_text())
    assert list(found["held_out"]["recordings"]) == [CAPTURES[2]]
    assert found["held_out"]["found"] < 0.1 * found["held_out"]["start"]
    values = {name: entry["value"] for name, entry in found["parameters"].items()}
    bending = SECRET.bend_stiffness / SECRET.density
    assert values["bending"] == pytest.approx(bending, rel=0.1)
    assert values["friction"] == pytest.approx(SECRET.friction, rel=0.03)
    assert values["latency"] == pytest.approx(LATE, abs=0.003)
    assert not any(clock["has_slipped"] for clock in found["clocks"].values())
    fabric = json.loads((tmp_path / "fabric.json").read_text())
    assert fabric["density"] == FABRIC.density
    again = CliRunner().invoke(commands.app, [*arguments, "--jobs", "2"], catch_exceptions=False)
    assert again.exit_code == 0
    assert json.loads((tmp_path / "identification.json").read_text()) == found


def test_what_no_list_has_needs_a_window(data, tmp_path):
    write_obj(tmp_path / "meshes" / "Green_Tshirt" / "green_tshirt_10k.obj")
    other = "green_tshirt_grasp_2026-01-01-00-00-00"
    source = data / "green_tshirt" / CAPTURES[0]
    shutil.copytree(source, tmp_path / "green_tshirt" / other)
    with pytest.raises(StoreError, match="say which seconds count"):
        garment_data.read_garments(tmp_path, "green_tshirt")
