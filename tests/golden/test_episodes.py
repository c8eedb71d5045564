"""No change of the code changes a number: physics, start states, rewards, observations, info."""

import json

import pytest

from tests.golden import episodes

GOLDEN = json.loads(episodes.PATH.read_text())
CASES = [
    pytest.param(
        task,
        settings,
        variation,
        id=episodes.name(task, settings, variation).replace(" ", "-"),
        marks=[] if settings["fidelity"] == "fast" and variation == 800 else pytest.mark.slow,
    )
    for task, settings, variations in episodes.cases()
    for variation in variations
]


@pytest.mark.parametrize(("task", "settings", "variation"), CASES)
def test_episodes_are_what_they_were(task, settings, variation):
    golden = GOLDEN[episodes.name(task, settings, variation)]
    assert episodes.play(task, settings, variation) == golden


def test_there_is_nothing_else():
    names = {episodes.name(t, s, v) for t, s, variations in episodes.cases() for v in variations}
    assert names == set(GOLDEN)
