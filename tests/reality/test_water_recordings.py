"""Recordings of water: read as written, nothing executed, other files refused."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.water import experiment
from softgym_mj.reality.water.recordings import DAM_BREAKS, SPHERIC, read_heights, read_table
from softgym_mj.reality.water.settings import SETTINGS
from tests.reality import waters

FRONT = np.array([[0.0, 1.0], [0.8, 1.3], [1.6, 2.0], [2.4, 2.9]])


def test_a_table_comes_back_sorted_and_its_file_is_not_executed(tmp_path):
    file = tmp_path / DAM_BREAKS
    waters.write_tables(file, {"other": FRONT + 1, "ko_data": FRONT[[1, 0, 2, 3]]})
    series = read_table(tmp_path, DAM_BREAKS, "ko_data")
    np.testing.assert_array_equal(np.transpose([series.times, series.values]), FRONT)
    assert not file.with_suffix(".ran").exists()


def test_heights_come_back_as_written(tmp_path):
    times, heights = np.arange(5) / 10, np.arange(20.0).reshape(5, 4)
    waters.write_heights(tmp_path / SPHERIC, times, heights)
    series = read_heights(tmp_path)
    np.testing.assert_array_equal([s.values for s in series], heights.T)
    np.testing.assert_array_equal(series[0].times, times)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "ko_data = (",
        "ko_data = open('x').read()",
        "ko_data = f'{1} {2}'",
        "ko_data = 5",
        "ko_data = '1 2\\n3 4\\n5'",
        "ko_data = '1 2\\n3 4\\n5 6'",
        "ko_data = '1 2\\n3 4\\n5 6\\n7 nan'",
        "ko_data = '1 2\\n3 4\\n5 6\\n7 x'",
        "ko_data = '1 2\\n1 4\\n1 6\\n1 8'",
        "ko_data = " + "(" * 5000 + ")" * 5000,
        "ko_data\0 = ''",
    ],
)
def test_other_python_files_are_refused_by_name(tmp_path, content):
    (tmp_path / DAM_BREAKS).write_text(content)
    with pytest.raises(StoreError, match=r"db_exp_data\.py"):
        read_table(tmp_path, DAM_BREAKS, "ko_data")


def test_damaged_heights_are_refused_by_name(tmp_path):
    file = tmp_path / SPHERIC
    waters.write_heights(file, np.arange(5.0), np.ones((5, 4)))
    good = file.read_text()
    for bad in ("", good.partition("\n")[2], good[:-9], good.replace("1.0", "one"), good[:200]):
        file.write_text(bad)
        with pytest.raises(StoreError, match=r"test_case_2_exp_data\.dat"):
            read_heights(tmp_path)
    file.write_bytes(b"\xff\xfe" * 50)
    with pytest.raises(StoreError, match="is not text"):
        read_heights(tmp_path)


def test_a_missing_file_says_where_it_is_and_under_which_license(tmp_path):
    for folder in (None, tmp_path):
        with pytest.raises(InvalidArgumentError, match=r"PySPH.*BSD-3.*downloads nothing"):
            read_table(folder, DAM_BREAKS, "ko_data")
        with pytest.raises(InvalidArgumentError, match=r"aquagpusph.*GPL-3"):
            read_heights(folder)


def test_the_command_prints_and_writes_errors(tmp_path, monkeypatch):
    monkeypatch.setitem(experiment.LAYERS, "dam_break", (8, 12))
    waters.write_tables(tmp_path / DAM_BREAKS, dict.fromkeys(waters.DAM_BREAKS, FRONT * [1, 9]))
    out = tmp_path / "out.json"
    arguments = ["validate", "water", str(tmp_path), "--experiment", "dam_break"]
    arguments += ["--resolution", "coarse", "--out", str(out)]
    result = CliRunner().invoke(commands.app, arguments)
    assert result.exit_code == 1, result.output  # The front is nine times too slow.
    rows = json.loads(out.read_text())["measurements"]
    assert len(rows) == 4 * 2 * len(SETTINGS)
    fronts = [row["error"] for row in rows if row["quantity"] == "front"]
    assert all(0.8 < front < 0.95 for front in fronts)
    assert f"{100 * fronts[0]:+.1f}" in result.output
    assert "0 of 8 within their bounds" in result.output


def test_the_command_refuses_unknown_names(tmp_path):
    for option in ("--experiment", "--resolution"):
        result = CliRunner().invoke(commands.app, ["validate", "water", str(tmp_path), option, "x"])
        assert result.exit_code != 0
        assert isinstance(result.exception, InvalidArgumentError)
