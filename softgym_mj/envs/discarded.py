"""Memory of discarded environments.

Entities and their MJCF elements refer to each other, so the memory of a discarded environment is
freed by Python's cycle collector only. The collector counts objects and ignores the 15 to 45 MB
that MuJoCo and the plugins have allocated for an environment: ten and more of them can wait.
"""

import gc
import weakref

MOST_WAITING = 4  # Discarded environments that may wait for the collector.
_waiting = 0


def watch(environment: object) -> None:
    """Counts an environment as waiting once it is discarded."""
    weakref.finalize(environment, _count).atexit = False


def collect() -> None:
    """Runs the cycle collector if too many environments wait, unless `gc.disable` was called."""
    global _waiting  # noqa: PLW0603 - the collector is one for the process, too.
    if _waiting >= MOST_WAITING and gc.isenabled():
        _waiting = 0
        gc.collect()


def _count() -> None:
    global _waiting  # noqa: PLW0603
    _waiting += 1
