"""Recordings of water: read as written, hostile files refused; errors by hand; the command."""

import json

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.water import comparison
from softgym_mj.reality.water.dam_breaks import DamBreak, Obstacle
from softgym_mj.reality.water.experiments import Run
from softgym_mj.reality.water.recordings import (
    DAM_BREAKS,
    SLOSHING,
    SOURCES,
    SPHERIC,
    Series,
    read_spheric,
    read_table,
)
from softgym_mj.reality.water.signals import errors, likeness
from tests.command import invoked
from tests.reality.waters import HEADER, write_spheric, write_tables

FRONT = np.array([[0.0, 1.0], [0.5, 1.1], [1.5, 1.9]])


def test_tables_come_back_bit_by_bit_in_the_order_of_time(tmp_path):
    shuffled = {"ko_data": FRONT[[1, 0, 2]], "mm_data_1": FRONT + 0.25}
    write_tables(tmp_path, DAM_BREAKS, shuffled)
    for name, table in {"ko_data": FRONT, "mm_data_1": FRONT + 0.25}.items():
        read = read_table(tmp_path, DAM_BREAKS, name)
        np.testing.assert_array_equal(np.column_stack([read.times, read.values]), table)


def test_heights_come_back_bit_by_bit(tmp_path):
    times = np.arange(5) * 1e-3
    heights = np.random.default_rng(0).uniform(0.0, 0.5, (5, 4))
    write_spheric(tmp_path, times, heights)
    read = read_spheric(tmp_path)
    np.testing.assert_array_equal(read.times, times)
    np.testing.assert_array_equal(read.values, heights)


@pytest.mark.parametrize(
    "code",
    [
        "import os; os.mkdir({mark!r})",
        "late = __import__('os').mkdir({mark!r})",
        "class Late:\n    ran = __import__('os').mkdir({mark!r})",
    ],
)
def test_code_in_a_file_of_tables_is_not_run(tmp_path, code):
    mark = tmp_path / "ran"
    write_tables(tmp_path, DAM_BREAKS, {"ko_data": FRONT}, code.format(mark=str(mark)))
    assert len(read_table(tmp_path, DAM_BREAKS, "ko_data").times) == len(FRONT)
    if "late" in code:
        with pytest.raises(StoreError, match="assigns no text to late"):
            read_table(tmp_path, DAM_BREAKS, "late")
    assert not mark.exists()


def test_damaged_and_other_tables_are_refused_by_name(tmp_path):
    file = tmp_path / DAM_BREAKS
    contents = [b"", b"\xff\xfe", b"ko_data = ", b"ko_data = 3", b"a.ko_data = '1 2'"]
    contents += [b"ko_data = f'{1}'", b"ko_data = '1 2'", b"ko_data = '1 2\\n3'"]
    contents += [b"ko_data = '1 2\\n3 4 5'", b"ko_data = '1 2\\n3 nan'", b"ko_data = '1 2\\n3 x'"]
    contents += [b"\x00", b"(" * 10_000, b"ko_data = " + b"-" * 100_000 + b"1"]
    contents += [np.random.default_rng(i).bytes(64) for i in range(30)]
    for content in contents:
        file.write_bytes(content)
        with pytest.raises(StoreError, match=DAM_BREAKS):
            read_table(tmp_path, DAM_BREAKS, "ko_data")


def test_damaged_heights_are_refused(tmp_path):
    write_spheric(tmp_path, np.arange(3.0), np.zeros((3, 4)))
    file = tmp_path / SPHERIC
    good = file.read_text()
    row = " ".join(["0"] * 13)
    for content in ("", HEADER, good.replace("H4", "H5"), good + "1 2\n", good + row, good + "x"):
        file.write_text(content)
        with pytest.raises(StoreError, match=f"{SPHERIC} is not a recording"):
            read_spheric(tmp_path)


def test_a_folder_without_files_says_where_they_are(tmp_path):
    for folder in (None, tmp_path):
        for name, experiment in comparison.EXPERIMENTS.items():
            with pytest.raises(InvalidArgumentError, match="downloads nothing") as error:
                experiment.read(folder)
            assert any(source in str(error.value) for source in SOURCES.values()), name
    with pytest.raises(InvalidArgumentError, match="experiment='nope' is unknown"):
        list(comparison.measure(tmp_path, ["nope"], {}))
    with pytest.raises(InvalidArgumentError, match="cells"):
        list(comparison.measure(tmp_path, ["faltinsen"], {}, [1]))


def test_errors_are_those_worked_out_by_hand():
    assert errors(np.array([1.0, 3.0]), np.array([0.0, 0.0])) == pytest.approx((np.sqrt(5), 2))
    recording = Series(np.array([1.0, 2.0]), np.array([2.0, 4.0]))
    run = Run(np.array([0.0, 4.0]), np.array([1.0, 5.0]))  # 2 and 3 at the times.
    dam = DamBreak("ko_data", 0.1, 4.0)
    front, late = dam.compare(recording, run)
    assert late.value == front.value  # It is behind: no delay is better.
    assert front.value == pytest.approx(np.sqrt((0.25**2) / 2))
    assert front.mean == pytest.approx(-0.125)
    ahead = Run(run.times, np.array([1.0, 9.0]))  # The recording is released half a unit later.
    late = dam.compare(Series(np.array([1.0, 2.0]), np.array([2.0, 4.0])), ahead)[1]
    assert late.quantity == f"front released {500 * dam.unit:.0f} ms later"
    assert late.value == pytest.approx(0.0, abs=1e-9)
    # 1 + 2 t fits one position after a delay of 0.5, the other after 0.25: each sees the other's.
    late = dam.compare(Series(np.array([1.0, 2.0]), np.array([2.0, 4.5])), ahead)[1]
    assert late.value == pytest.approx(np.sqrt(((2.5 / 2 - 1) ** 2 + (4 / 4.5 - 1) ** 2) / 2))
    heights = np.array([[0.1, 0.2, 0.3, 0.4]] * 2)
    run = Run(np.array([0.0, 9.0]), heights + [0.055, -0.11, 0.0, 0.0])
    found = Obstacle().compare(Series(np.array([1.0, 2.0]), heights), run)
    assert [error.quantity for error in found] == ["H1", "H2", "H3", "H4"]
    assert [error.value for error in found] == pytest.approx([0.1, 0.2, 0.0, 0.0])
    assert [error.mean for error in found] == pytest.approx([0.1, -0.2, 0.0, 0.0])


@pytest.mark.parametrize("period", [0.9, 1.0, 1.03, 1.15])
def test_a_stretched_and_scaled_oscillation_is_found(period):
    def signal(t):
        return np.sin(2 * np.pi * t / 1.3) - 0.6 * np.sin(2 * np.pi * t / 1.667)

    times, at = np.linspace(0.0, 15.0, 3000), np.sort(np.random.default_rng(0).uniform(0, 10, 150))
    found = likeness(times, 0.8 * signal(times / period), at, signal(at))
    assert found.period == pytest.approx(period, abs=0.002)
    if period == 1.0:
        assert found.amplitude == pytest.approx(0.8, rel=1e-3)


def test_the_command_prints_and_writes_errors(tmp_path):
    write_tables(tmp_path, DAM_BREAKS, {"ko_data": FRONT, "ko_mps_data": FRONT * [1.0, 1.1]})
    times = np.linspace(0.0, 1.0, 30)
    linear = comparison.EXPERIMENTS["faltinsen"].others(None, 1.0)["linear waves"]
    wave = np.column_stack([times, np.interp(times, linear.times, linear.values)])
    write_tables(tmp_path, SLOSHING, {"faltinsen": wave})
    out = tmp_path / "out.json"
    chosen = ["--experiment", "koshizuka_oka_sudden", "--experiment", "faltinsen"]
    result = invoked("validate", "water", tmp_path, "--cells", 4, "--out", out, *chosen)
    assert result.exit_code in (0, 1), result.output
    rows = json.loads(out.read_text())["measurements"]
    by = {(row["solution"], row["error"]["quantity"]): row["error"]["value"] for row in rows}
    assert by["MPS of Koshizuka and Oka", "front"] == pytest.approx(0.1)
    assert by["linear waves", "period"] == pytest.approx(0.0, abs=0.001)
    assert by["linear waves", "amplitude"] == pytest.approx(0.0, abs=0.001)
    assert by["linear waves", "elevation"] == pytest.approx(0.0, abs=0.001)
    simulated = [row for row in rows if row["cells"]]
    assert len(simulated) == 2 * (2 + 3)
    assert all(row["particles"] > 0 and np.isfinite(row["error"]["value"]) for row in simulated)
    judged = [row["error"] for row in simulated if row["error"]["bound"] is not None]
    missed = any(abs(error["value"]) > error["bound"] for error in judged)
    assert result.exit_code == int(missed)
    assert "+10.0" in result.output
