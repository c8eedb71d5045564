"""Processes that know nothing of the program's script."""

import contextlib
import sys
import threading
import types
from collections.abc import Iterator

_STARTING = threading.Lock()  # Of a thread that starts processes.


@contextlib.contextmanager
def unknown_main() -> Iterator[None]:
    """Processes that are started meanwhile do not run the program's script again.

    What they need of it is pickled by value. So scripts need no `if __name__ == "__main__":`, those
    without a file (stdin) work, and nobody waits for what else a script imports.
    """
    with _STARTING:
        main, sys.modules["__main__"] = sys.modules["__main__"], types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main
