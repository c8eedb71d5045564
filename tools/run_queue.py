"""Runs what docs/results/queue.toml lists and learning.csv lacks, as much as fits into minutes.

    python -m tools.run_queue   # lists the runs
    python -m tools.run_queue --minutes 25 --cards 2

Each card runs one command at a time, in order of the queue, of those whose estimate fits into the
minutes that are left. What ends is merged into learning.csv; what does not, the next call continues
from its checkpoint. Run `python -m tools.tables` afterwards.
"""

import argparse
import dataclasses
import os
import pathlib
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

from softgym_mj.learning.results import read_rows
from tools.learned import RESULTS
from tools.queued_runs import QueuedRun, read_queue

_POLL = 1.0  # [s] Between two looks at what runs.


@dataclasses.dataclass
class Cards:
    """Schedule of runs on GPUs.

    Attributes:
        number: of GPUs.
        minutes: for all.
        start: starts a command on a GPU; its result has `poll` and `kill`, as of `Popen`.
        clock: seconds.
        wait: waits for seconds.
    """

    number: int
    minutes: float
    start: Callable[[QueuedRun, int], subprocess.Popen]
    clock: Callable[[], float] = time.monotonic
    wait: Callable[[float], None] = time.sleep

    def run(self, runs: Sequence[QueuedRun], on_end: Callable[[QueuedRun, int], None]) -> None:
        """Runs what fits, and stops what runs when the minutes are over.

        Args:
            runs: on a GPU, in order.
            on_end: called with a run that has ended, and its exit status.
        """
        left, end = [*runs], self.clock() + 60.0 * self.minutes
        running: dict[int, tuple[QueuedRun, subprocess.Popen]] = {}
        while True:
            for card in range(self.number):
                if card in running:
                    continue
                minutes = (end - self.clock()) / 60.0
                fits = (run for run in left if (run.gpu_minutes or 0.0) <= minutes)
                if (run := next(fits, None)) is not None:
                    left.remove(run)
                    running[card] = run, self.start(run, card)
            if not running:
                return
            self.wait(_POLL)
            for card, (run, process) in [*running.items()]:
                if (status := process.poll()) is not None:
                    del running[card]
                    on_end(run, status)
            if self.clock() > end:
                for _, process in running.values():
                    process.kill()
                    process.wait()
                return


def waiting(results: pathlib.Path) -> list[QueuedRun]:
    """Runs that are not done."""
    rows = read_rows(results / "learning.csv")
    return [run for run in read_queue(results / "queue.toml") if not run.is_done(rows)]


def _start(run: QueuedRun, card: int) -> subprocess.Popen:
    folder = pathlib.Path(run.folder)
    folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "CUDA_VISIBLE_DEVICES": str(card)}
    command = [sys.executable, "-m", "softgym_mj.cli.commands", *shlex.split(run.command)[1:]]
    print(f"card {card}: {run.command}", flush=True)
    with (folder / "log.txt").open("ab") as log:
        return subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)


def _merge(run: QueuedRun, status: int, results: pathlib.Path) -> None:
    print(f"ended with {status}: {run.folder}", flush=True)
    if status == 0:
        command = [sys.executable, "-m", "softgym_mj.cli.commands", "learning", "table", run.folder]
        subprocess.run([*command, "--merge", "--results", str(results)], check=False)


def main() -> None:
    """Runs the queue of this checkout."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--minutes", type=float, help="For all runs; without it, they are listed.")
    parser.add_argument("--cards", type=int, default=1, help="GPUs of this machine.")
    parser.add_argument("--method", help="Only runs of this method, such as distill.")
    given = parser.parse_args()
    runs = [run for run in waiting(RESULTS) if given.method in (None, run.method)]
    if given.minutes is None:
        print(*(f"{run.cost}: {run.why}\n    {run.command}" for run in runs), sep="\n")
        return
    cards = Cards(given.cards, given.minutes, _start)
    on_gpus = [run for run in runs if run.gpu_minutes is not None]
    cards.run(on_gpus, lambda run, status: _merge(run, status, RESULTS))


if __name__ == "__main__":
    main()
