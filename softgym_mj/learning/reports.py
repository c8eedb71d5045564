"""Reports of a training's progress, made by a thread: one vector step may take minutes."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

from softgym_mj.learning.training import Training

LINE_SECONDS = 60.0  # Between two lines of a log.


@contextlib.contextmanager
def repeated(function: Callable[[], None], seconds: float) -> Iterator[None]:
    """Calls a function every so many seconds, in a thread, and once more at the end."""
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


def line(training: Training, text: str) -> None:
    """Prints a line about a training with the time of day, and flushes it."""
    seeds = ", ".join(map(str, training.seeds))
    name = f"{training.method.name} {training.settings.task}, seeds {seeds}"
    print(f"{time.strftime('%H:%M:%S')} {name}: {text}", flush=True)


def start(training: Training) -> str:
    """How a training starts, in words; of one whose checkpoint has been read."""
    if training.covered:
        return f"continues from {training.covered:,} env steps of {training.folder}"
    return f"starts in {training.folder}"
