"""Recordings of cables: read as written, hostile files refused; baselines by hand."""

import collections
import json
import os
import pickle

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, SimulationError, StoreError
from softgym_mj.reality.rope.experiment import errors, measure
from softgym_mj.reality.rope.recordings import SOURCE, Recording, read_recording, read_recordings
from softgym_mj.reality.rope.scenario import EndsInterpolated, NothingMoves, scenario_of
from tests.command import output_of
from tests.reality import cables


def test_recordings_come_back_bit_by_bit_in_the_order_of_their_numbers(tmp_path):
    written = {name: cables.swinging() + float(name) for name in ("10", "9")}
    for name, markers in written.items():
        cables.write(tmp_path, "DLO2", "train", name, markers)
    read = read_recordings(tmp_path, "DLO2", "train")
    assert [(recording.cable, recording.name) for recording in read] == [
        ("DLO2", "9"),
        ("DLO2", "10"),
    ]
    for recording in read:
        assert recording.markers.tobytes() == written[recording.name].tobytes()


class _Hostile:
    def __init__(self, *call):
        self.call = call

    def __reduce__(self):
        return self.call[0], self.call[1:]


@pytest.mark.parametrize(
    "made",
    [
        lambda mark: _Hostile(os.mkdir, mark),
        lambda mark: [[[0.1, _Hostile(os.mkdir, mark)]]],
        lambda mark: _Hostile(eval, f"__import__('os').mkdir({mark!r})"),
        lambda mark: collections.OrderedDict(),
        lambda mark: np.zeros((5, 3, 8)),
    ],
    ids=["call", "nested call", "eval", "class", "array"],
)
@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_a_pickle_that_names_code_is_refused_and_runs_nothing(tmp_path, made, protocol):
    file, mark = tmp_path / "1.pkl", tmp_path / "ran"
    file.write_bytes(pickle.dumps(made(str(mark)), protocol))
    with pytest.raises(StoreError, match=r"1\.pkl is not a recording: it names .*could run code"):
        read_recording("DLO1", file)
    assert not mark.exists()


def test_damaged_and_other_files_are_refused_by_name(tmp_path):
    file = tmp_path / "1.pkl"
    good = pickle.dumps(cables.swinging().transpose(0, 2, 1).tolist())
    nan = cables.swinging().transpose(0, 2, 1)
    nan[3, 1, 2] = np.nan
    itself: list[object] = []
    itself.append(itself)
    others = [np.zeros((9, 3, 5)).tolist(), np.zeros((2, 3, 8)).tolist(), [[1.0], [2.0, 3.0]]]
    others += [{}, "text", {"a": 1}, nan.tolist(), itself]
    rng = np.random.default_rng(0)
    damaged = [b"", good[:-1], good[: len(good) // 2], *(rng.bytes(64) for _ in range(50))]
    for content in [*damaged, *map(pickle.dumps, others)]:
        file.write_bytes(content)
        with pytest.raises(StoreError, match=r"1\.pkl is not a recording"):
            read_recording("DLO1", file)
    file.write_bytes(good)
    assert read_recording("DLO1", file).markers.shape == (30, 8, 3)


def test_a_wrong_folder_says_where_the_recordings_are(tmp_path):
    for folder, words in ((None, "`folder` is missing"), (tmp_path, "folder='.*' is not valid")):
        with pytest.raises(InvalidArgumentError, match=f"{words}.*{SOURCE}.*no license file"):
            read_recordings(folder, "DLO1", "eval")
    with pytest.raises(InvalidArgumentError, match="cable='DLO6' is unknown"):
        read_recordings(tmp_path, "DLO6", "eval")
    cables.write(tmp_path, "DLO1", "eval", "1", cables.swinging())
    cables.write(tmp_path, "DLO1", "eval", "2", cables.swinging(markers=9))
    with pytest.raises(StoreError, match=r"2\.pkl has 9 markers, .*1\.pkl has 8"):
        read_recordings(tmp_path, "DLO1", "eval")


def test_baselines_and_errors_are_those_of_a_motion_worked_out_by_hand():
    markers = np.zeros((4, 6, 3))
    markers[..., 0] = np.arange(6.0)
    markers[2:, :, 2] = 0.6  # All markers are lifted after the start.
    markers[3, -2:, 2] = 1.6  # Then one end alone.
    scenario = scenario_of(Recording("DLO1", "1", markers))
    still = NothingMoves().predict(scenario)
    np.testing.assert_array_equal(still[:, 2:4], markers[[1, 1], 2:4])
    assert errors(still, markers[2:]) == pytest.approx((0.6 * 2 / 6 / 3, 0.6 / 3))
    between = EndsInterpolated().predict(scenario)
    np.testing.assert_allclose(between[0], markers[2])
    np.testing.assert_allclose(between[1, :, 2], [0.6, 0.6, 1.0, 1.2, 1.6, 1.6])
    for predicted in (still, between):
        np.testing.assert_array_equal(predicted[:, [0, 1, 4, 5]], markers[2:, [0, 1, 4, 5]])


def test_a_solver_sees_the_start_and_the_held_markers_only():
    seen = []

    class Diverges:
        name, models = "diverges", ()

        def predict(self, scenario):
            seen.append(scenario)
            return np.full((len(scenario.held), cables.MARKERS, 3), np.nan)

    recording = Recording("DLO1", "7", cables.swinging())
    with pytest.raises(SimulationError, match="diverges, DLO1 7: diverged"):
        measure(Diverges(), [recording])
    (scenario,) = seen
    assert scenario.start.shape == (2, cables.MARKERS, 3)
    assert scenario.held.shape == (cables.FRAMES - 2, 4, 3)


def test_the_command_prints_and_writes_errors(tmp_path):
    for split in ("eval", "train"):
        cables.write(tmp_path, "DLO3", split, "1", cables.swinging())
    out = tmp_path / "out.json"
    arguments = ["validate", "rope", str(tmp_path), "--cable", "DLO3", "--out", str(out)]
    result = output_of(*arguments)
    found = {row["solver"]: row for row in json.loads(out.read_text())["measurements"]}
    moved = cables.swinging()
    off = np.abs(moved[2:, 2:-2] - moved[1, 2:-2]).mean()
    assert found["nothing moves"]["free_error"] == pytest.approx(off)
    assert f"{1e3 * off:.1f}" in result
    assert found["displacement of the ends, interpolated"]["error"] == pytest.approx(0, abs=1e-12)
