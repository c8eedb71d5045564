"""Recordings of a cloth: read as written, bad rows named; clocks and frames; baselines."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.cloth.experiment import measure, quality, split
from softgym_mj.reality.cloth.recordings import SOURCE, read_recording, read_recordings
from softgym_mj.reality.cloth.scenario import (
    DELAY,
    NothingMoves,
    RigidSheet,
    counted_frames,
    grip_of,
    scenario_of,
)
from tests.reality import cloths


def test_recordings_come_back_in_the_order_of_their_numbers(tmp_path):
    written = {f"range30_rep{i}": cloths.rigid(f"range30_rep{i}", 0.01 * i) for i in (10, 9)}
    written["range30_rep9"].nodes[3, 1, 2] = np.nan
    for own in written.values():
        cloths.write(tmp_path, own)
    cloths.write(tmp_path, cloths.rigid("n4_calibration", 0.0))
    read = read_recordings(tmp_path)
    assert [own.name for own in read] == ["range30_rep9", "range30_rep10"]
    for own in read:
        for field in dataclasses.fields(own):
            if field.name != "name":
                expected = getattr(written[own.name], field.name)
                np.testing.assert_allclose(getattr(own, field.name), expected, atol=1e-6)
    first, test = split([*read, *read])
    assert [own.name for own in (*first, *test)] == [read[i].name for i in (0, 1, 0, 1)]


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("mesh", ",4,", ",5,", r"_mesh.csv, row 1: the field 'field.x16' is missing"),
        ("mesh", "camera,4,", "camera,3,", r"row 2, field 'field.size': 3 is not a whole number"),
        ("mesh", "field.y3", "field.y33", r"row 1: the field 'field.y3' is missing"),
        ("mesh", "camera", "camera,1", r"row 2: 54 fields, expected 53"),
        ("tcp", "base,0.0", "base,x", r"_tcp.csv, row 2, field 'field.pose.position.x': 'x'"),
        ("tcp", "base,0.0", "base,nan", r"row 2, field 'field.pose.position.x': 'nan' is not a f"),
        ("tcp", "0,0,16", "0,0,26", r"row 3, field 'field.header.stamp': it is earlier"),
        ("tcp", "base,0.0,-0.4,0.34", "base,0.0,-0.4,0.34,2", r"row 2: 12 fields, expected 11"),
        ("tcp", "orientation.w", "orientation.v", r"the field 'field.pose.orientation.w' is miss"),
    ],
)
def test_bad_rows_are_named(tmp_path, file, old, new, message):
    cloths.write(tmp_path, cloths.rigid("range30_rep1", 0.1))
    path = tmp_path / f"range30_rep1_{file}.csv"
    text = path.read_text()
    assert old in text
    count = -1 if old == ",4," else 1
    path.write_text(text.replace(old, new, count))
    with pytest.raises(StoreError, match=message):
        read_recording(tmp_path, "range30_rep1")


def test_missing_files_and_folders_are_named(tmp_path):
    for folder, words in ((None, "`folder` is missing"), (tmp_path, "folder='.*' is not valid")):
        with pytest.raises(InvalidArgumentError, match=f"{words}.*{SOURCE}.*no license file"):
            read_recordings(folder)
    cloths.write(tmp_path, cloths.rigid("range30_rep1", 0.1))
    (tmp_path / "n4_calibration_campose.csv").unlink()
    with pytest.raises(StoreError, match=r"n4_calibration_campose\.csv cannot be read"):
        read_recordings(tmp_path)
    with pytest.raises(InvalidArgumentError, match="recordings=3"):
        split([cloths.rigid("a", 0.1)] * 3)


def test_a_rigid_sheet_has_no_error_and_one_that_does_not_move_that_of_the_tool():
    own = cloths.rigid("a", 0.1, turn=0.3)
    grip = grip_of([own])
    np.testing.assert_allclose(grip.edge, cloths.GRIP.edge, atol=1e-9)
    np.testing.assert_allclose(grip.lengths, cloths.SIDE, atol=1e-9)
    assert grip.pitch == pytest.approx(0.0, abs=1e-9)
    _, nodes = scenario_of(own, grip)
    np.testing.assert_allclose(nodes, own.nodes[1:], atol=1e-9)
    assert measure(RigidSheet(), [own], grip).error == pytest.approx(0.0, abs=1e-9)
    still = measure(NothingMoves(), [own], grip)
    moved = np.linalg.norm(own.nodes[1:] - own.nodes[0], axis=3)
    assert still.error == pytest.approx(moved.mean())
    assert still.held_error == pytest.approx(moved[:, :, 0].mean())
    assert still.far_error == pytest.approx(moved[:, :, -1].mean())
    found = quality([own], grip)
    assert (found.frames, found.complete, found.counted) == (25, 25, 25)
    assert found.noise == pytest.approx(0.0, abs=1e-9)


def test_frames_are_dated_by_the_held_edge():
    own = cloths.rigid("a", 0.2)
    late = np.random.default_rng(0).uniform(-0.08, 0.08, len(own.stamps))
    _, times, _ = counted_frames(dataclasses.replace(own, stamps=own.stamps + late), cloths.GRIP)
    true = own.stamps - DELAY
    at, _ = cloths.tool(0.2, true)
    fast = np.linalg.norm(np.gradient(at, true, axis=0), axis=1) > 0.4
    assert fast.sum() > 5
    # Delays are weighed against distances: a third of a small difference remains at .4 m/s.
    assert np.abs(times - true)[fast].max() < 0.03


def test_frames_off_the_tool_or_of_another_size_or_incomplete_are_left_out():
    own = cloths.rigid("a", 0.1)
    own.nodes[4] += [0.0, 0.0, 0.05]  # Another part of the hem was taken for the edge.
    own.nodes[6, :, 1:, 2] += np.linspace(0.02, 0.1, cloths.NODES - 1)  # Or for the far one.
    own.nodes[8, 2, 2] = np.nan
    counted, _, _ = counted_frames(own, cloths.GRIP)
    assert sorted(set(range(25)) - set(counted.tolist())) == [4, 6, 8]
    everything, _, _ = counted_frames(own, cloths.GRIP, every=True)
    assert sorted(set(range(25)) - set(everything.tolist())) == [8]
    own.nodes[:] = np.nan
    with pytest.raises(StoreError, match="no frame has all nodes"):
        grip_of([own])
    with pytest.raises(StoreError, match="recording a: 0 frames count"):
        scenario_of(own, cloths.GRIP)


def test_the_pitch_of_the_camera_is_found_at_rest():
    own = cloths.rigid("a", 0.1)
    pitch = Rotation.from_euler("x", 0.04).as_matrix()
    tilted = dataclasses.replace(own, nodes=own.nodes @ pitch.T)
    assert grip_of([tilted]).pitch == pytest.approx(-0.04, abs=1e-6)
