"""What a queue runs within some minutes, on cards of an invented clock."""

import pytest

from tools.queued_runs import QueuedRun
from tools.run_queue import Cards


class Bench:
    """Runs that take as long as they are said to, in `Cards`."""

    def __init__(self, takes):
        self.now, self.takes, self.log = 0.0, takes, []

    def start(self, run, card):
        self.log.append((self.now / 60, "starts", run.why, card))
        return _Process(self, run.why, self.now + 60 * self.takes[run.why])

    def on_end(self, run, status):
        self.log.append((round(self.now / 60), "ended", run.why, status))

    def play(self, cards, minutes, runs):
        own = Cards(cards, minutes, self.start, lambda: self.now, self._wait)
        own.run(runs, self.on_end)
        return self.log

    def _wait(self, seconds):
        self.now += seconds


class _Process:
    def __init__(self, bench, name, end):
        self._bench, self._name, self._end = bench, name, end

    def poll(self):
        return 0 if self._bench.now >= self._end else None

    def kill(self):
        self._bench.log.append((round(self._bench.now / 60), "killed", self._name))

    def wait(self):
        pass


def _runs(**minutes):
    return [
        QueuedRun("fold_cloth", "sac", "fast", 1, name, gpu_minutes=each)
        for name, each in minutes.items()
    ]


def test_two_cards_by_hand():
    runs = _runs(a=10, b=10, c=25, d=5)
    log = Bench({"a": 8, "b": 10, "d": 5}).play(2, 20, runs)
    assert log == [
        (0, "starts", "a", 0), (0, "starts", "b", 1), (8, "ended", "a", 0),
        (8, "starts", "d", 0), (10, "ended", "b", 0), (13, "ended", "d", 0),
    ]  # fmt: skip


def test_what_takes_longer_than_its_estimate_is_stopped():
    log = Bench({"a": 90}).play(1, 20, _runs(a=10))
    assert log == [(0, "starts", "a", 0), (20, "killed", "a")]


def test_nothing_that_does_not_fit_is_started():
    assert Bench({}).play(2, 4, _runs(a=10, b=5)) == []


def test_commands_have_the_teacher():
    run = QueuedRun("fold_cloth", "distill", "fast", 5, "", teacher="fold_cloth-sac", gpu_minutes=5)
    assert "--seeds 5 --teacher fold_cloth-sac --trust --device cuda --out" in run.command
    assert run.folder == run.command.split(" --out ")[1]
    with pytest.raises(TypeError):
        QueuedRun("fold_cloth", "distill", "fast", 5, "", teachers="x", gpu_minutes=5)
