"""Validation with garments: on captures that the package's own simulation and writers make."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import garments
from softgym_mj.reality.garment_windows import WINDOWS, Window
from softgym_mj.reality.replay import recorded_path
from softgym_mj.reality.validation import garment_cases
from tests.reality.captures import (
    FLING,
    GRASP,
    NAMES,
    SAMPLED,
    hands,
    write_capture,
    write_obj,
)

FRAMES = {FLING: np.array([0.2, 0.3, 0.4]), GRASP: np.array([3.9, 4.1, 4.3, 4.5])}


@pytest.fixture(name="data", scope="module")
def _data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("garments")
    write_obj(folder / "meshes" / "Green_Tshirt" / "green_tshirt_10k.obj")
    for name, frames in FRAMES.items():
        write_capture(folder, name, frames)
    return folder


def measured(folder, **changes):
    found = garment_cases.check(folder, ["green_tshirt"])
    return {case.name: case for case in garment_cases.run(folder, found, **changes)}


def test_columns_of_joints_come_back_bit_by_bit(tmp_path):
    written = write_capture(tmp_path, GRASP, FRAMES[GRASP][:1])
    read = garments.read_capture(tmp_path / "green_tshirt" / GRASP)
    for arm in garments.ARMS:
        for name in ("times", "positions", "ends"):
            ours, theirs = (getattr(c.arms[arm], name) for c in (written, read))
            assert ours.tobytes() == theirs.tobytes()
        assert read.arms[arm].names == NAMES
    file = tmp_path / "green_tshirt" / GRASP / "joints" / "left_arm_joint_states_and_end_pose.csv"
    assert file.read_text().splitlines()[0] == (
        "time,pos_1,pos_2,pos_3,pos_4,pos_5,pos_6,pos_gripper,pos_x,pos_y,pos_z"
    )
    file.write_text(file.read_text().replace("pos_y", "pos_w"))
    with pytest.raises(StoreError, match=r"left_arm.*lacks the columns pos_y"):
        garments.read_capture(tmp_path / "green_tshirt" / GRASP)


def test_the_list_is_that_of_98_captures(tmp_path):
    cases = [garments.case(tmp_path / name) for name in WINDOWS]
    assert len(cases) == 98
    assert {garment for garment, _ in cases} == set(garments.GARMENTS)
    assert cases[list(WINDOWS).index("white_dress_grasp_2025-07-19-18-56-12")] == (
        "white_cakeskirt",
        "grasp",
    )
    assert all(window.begin < window.end for window in WINDOWS.values())


def test_what_was_simulated_is_found_again(data):
    cases = measured(data, sampled=SAMPLED)
    assert set(cases) == {FLING, GRASP}
    for name, case in cases.items():
        np.testing.assert_allclose(case.times, FRAMES[name], atol=1e-6)
        # Stamps are exact to 0.2 us, and folds grow out of less.
        assert case.mean("surface_chamfer") < 1e-3
        assert case.mean("sim_to_real_euclid") < 1e-3
        # Vertices alone have a floor: points of the lattice between them are up to 10 mm away.
        assert 3e-3 < case.mean("chamfer") < 15e-3
        assert case.mean("height") < 5e-3  # Of vertices, and of points of the lattice.
        assert not case.failures
    assert cases[FLING].group == "green_tshirt/fling"
    # It hangs from the file's vertices, in 0.3 m.
    assert cases[FLING].held == (185, 76)
    hanging = cases[FLING].positions[0]
    assert hanging[[185, 76], 2].min() > 0.3 > hanging[:, 2].min() + 0.05
    # The nearest vertices were taken, and pulled up.
    assert cases[GRASP].held == (220, 0)
    times, places = hands("grasp")
    expected = recorded_path(times, places)(FRAMES[GRASP][1:])
    np.testing.assert_allclose(cases[GRASP].positions[1:, [220, 0]], expected, atol=1e-4)


def test_another_mesh_or_place_is_farther_away(data):
    found = garment_cases.check(data, ["green_tshirt"], ["grasp"])
    (moved,) = garment_cases.run(data, found, place=(0.13, 0.0), sampled=SAMPLED)
    assert moved.mean("surface_chamfer") > 5e-3


def test_slips_are_noted_and_not_repaired(tmp_path):
    write_obj(tmp_path / "meshes" / "Green_Tshirt" / "green_tshirt_10k.obj")
    write_capture(tmp_path, GRASP, FRAMES[GRASP], swapped=True)
    found = garment_cases.check(tmp_path, ["green_tshirt"])
    (wrong,) = garment_cases.run(tmp_path, found, sampled=SAMPLED)
    notes = " ".join(wrong.notes)
    assert "with the arms' bases exchanged" in notes
    assert "counts from 3.8 to 6.9 s, clouds are from 3.90 to 4.50 s" in notes
    assert "a delay" not in notes
    (right,) = garment_cases.run(tmp_path, found, sampled=SAMPLED, swapped=True)
    assert "exchanged" not in " ".join(right.notes)
    assert right.mean("surface_chamfer") < 1e-3
    assert wrong.mean("surface_chamfer") > 5e-3
    late = Window(0.474, 3.8, 6.9)
    (slipped,) = garment_cases.run(tmp_path, found, sampled=SAMPLED, swapped=True, window=late)
    assert "a delay of 0.474 s, at 0.200 s a frame" in " ".join(slipped.notes)
    np.testing.assert_allclose(slipped.times - right.times, 0.474 - 0.06024, atol=1e-6)


def test_repeats_are_compared_at_the_same_time_after_they_begin(data, tmp_path):
    write_obj(tmp_path / "meshes" / "Green_Tshirt" / "green_tshirt_10k.obj")
    other = "green_tshirt_grasp_2025-07-19-19-14-58"  # Counts from 4.0 s on, 0.2 s later.
    write_capture(tmp_path, GRASP, FRAMES[GRASP])
    write_capture(tmp_path, other, FRAMES[GRASP][:3] + 0.2, shift=0.004)
    cases = measured(tmp_path, sampled=SAMPLED)
    # The same motion, 4 mm higher.
    for name in (GRASP, other):
        np.testing.assert_allclose(cases[name].columns["real_height"][:3], 4e-3, rtol=0.05)
    assert np.isnan(cases[GRASP].columns["real_height"][3])  # The other one has ended.
    assert cases[GRASP].mean("real_height") == pytest.approx(4e-3, rel=0.05)


def test_what_is_missing_is_said(data, tmp_path):
    with pytest.raises(StoreError, match="Hugging Face"):
        garment_cases.check(tmp_path)
    found = garment_cases.check(data, ["green_tshirt"])
    assert len(found.missing) == 8  # Of ten.
    write_capture(tmp_path, GRASP, FRAMES[GRASP][:1])
    with pytest.raises(StoreError, match=r"green_tshirt_10k\.obj: a missing mesh"):
        measured(tmp_path)
    few = tmp_path / "few.obj"
    few.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(StoreError, match="no vertex 185"):
        measured(data, mesh=few)
    with pytest.raises(StoreError, match=r"no cloud from 8\.0 to 9\.0 s"):
        measured(data, window=Window(0.06, 8.0, 9.0))


def test_the_command_ranks_what_it_measured(data, tmp_path):
    arguments = ["validate", "garments", str(data), "--garment", "green_tshirt", "--action",
                 "grasp", "--sampled", "0.01", "--out", str(tmp_path)]  # fmt: skip
    result = CliRunner().invoke(commands.app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "report.json").read_text())
    ranked = found["groups"]["green_tshirt/grasp"]["ranked"]
    assert (ranked["rank"], ranked["of"]) == (1, 4)
    assert ranked["baselines"]["GarmentDynamics"] == 0.0226
    assert len(found["missing"]) == 3
    assert (tmp_path / f"{GRASP}.mp4").stat().st_size > 1000
