"""`softgym-mj list`, for people and for programs; names in the sheet of `demo`."""

import io

import numpy as np
import pytest
import rich.console

from softgym_mj import registry
from softgym_mj.cli import playing
from tests.command import output_of


@pytest.mark.parametrize("width", [80, 120])
def test_names_and_ids_are_whole_in_a_terminal(width, monkeypatch):
    terminal = rich.console.Console(
        file=io.StringIO(), width=width, force_terminal=True, color_system=None
    )
    monkeypatch.setattr(playing, "console", terminal)
    playing.list_tasks()
    lines = terminal.file.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    for name, record in registry.TASKS.items():
        (row,) = [i for i, line in enumerate(lines) if line.split()[:1] == [name]]
        identifier, *below = lines[row + 1].split()
        assert identifier == record.gymnasium_id
        assert (lines[row].split()[1], below[0]) == record.tags
        assert (lines[row].split()[2], below[1]) == (str(record.horizon), str(record.action_repeat))
        assert lines[row].split()[3] == record.summary.split()[0]


def test_a_program_reads_a_line_for_each_task():
    header, *lines = output_of("list").splitlines()
    for line, record in zip(lines, registry.TASKS.values(), strict=True):
        columns = dict(zip(header.split("\t"), line.split("\t"), strict=True))
        assert tuple(columns.pop("tags").split(",")) == record.tags
        for length in ("horizon", "action_repeat"):
            assert int(columns.pop(length)) == getattr(record, length)
        assert columns.pop("goal") == record.summary
        assert columns == {
            "suite": record.suite, "name": record.name, "gymnasium_id": record.gymnasium_id
        }  # fmt: skip


def test_the_demo_labels_strips_in_their_upper_left_corner():
    strip = np.full((96, 288, 3), 128, np.uint8)
    rows, columns, _ = np.nonzero(playing._labeled(strip, "fold_cloth") != strip)
    assert len(rows) > 100 and rows.max() < 24 and columns.max() < 96
