"""Scores on hidden categories: those of all experts and published policies."""

from benchmarks.hidden import FILE, HIDDEN, policies
from softgym_mj.registry import PLUS, TASKS, task_names
from softgym_mj.storage.files import read_json


def test_each_task_beyond_softgym_has_a_hidden_category():
    assert {*HIDDEN} == {*task_names(PLUS)}
    for task, settings in HIDDEN.items():
        TASKS[task].build(**settings)


def test_all_published_policies_are_scored():
    found = read_json(FILE)
    assert {task: {*own} for task, own in found.items()} == {
        task: {"scripted", *policies(task)} for task in HIDDEN
    }
