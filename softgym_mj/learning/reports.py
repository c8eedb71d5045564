"""Progress reports of a training, by a thread: a vector step can take minutes."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np

from softgym_mj.learning.training import Training

LINE_SECONDS = 10.0  # Interval of the lines of a log.


@contextlib.contextmanager
def repeated(function: Callable[[], None], seconds: float) -> Iterator[None]:
    """Calls a function periodically in a thread, and once more at the end."""
    is_over = threading.Event()

    def run() -> None:
        while not is_over.wait(seconds):
            function()

    thread = threading.Thread(target=run, name="progress of a training", daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
        function()


def line(text: str) -> None:
    """Prints a line with the time of day, and flushes it."""
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


def progress(training: Training) -> None:
    """Prints a line about the progress of a training."""
    line(f"{_name(training)}: {summary(training)}")


def summary(training: Training) -> str:
    """Returns a line with env steps, their rate, time left, updates and the last scores."""
    total, rate = training.settings.env_steps, training.env_steps / max(training.seconds, 1e-9)
    words = [f"{training.phase}: {training.env_steps:,} of {total:,} env steps"]
    if training.env_steps:
        words.append(f"{rate * len(training.seeds):.0f}/s")
    if 0 < training.env_steps < training.end:  # The estimate omits the final evaluation.
        words.append(f"{(total - training.env_steps) / rate / 60.0:.0f} min left")
    words.append(f"{training.learner.updates:,} updates")
    scores = [row for row in training.rows if row["split"] == "evaluate"][-len(training.seeds) :]
    if scores:
        mean = np.mean([row["normalized_performance"] for row in scores])
        words.append(f"held out {mean:.3f}")
    return ", ".join(words)


def start(training: Training) -> None:
    """Prints whether a training starts or continues from a checkpoint."""
    text = f"starts in {training.folder}"
    if training.env_steps:
        text = f"continues from {training.env_steps:,} env steps in {training.folder}"
    line(f"{_name(training)}: {text}")


def _name(training: Training) -> str:
    seeds = ", ".join(map(str, training.seeds))
    return f"{training.method.name} {training.settings.task}, seeds {seeds}"
