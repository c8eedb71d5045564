"""Worker processes that do not import the program's script."""

import contextlib
import sys
import threading
import types
from collections.abc import Iterator

_STARTING = threading.Lock()  # Held by the thread that starts processes.


@contextlib.contextmanager
def unknown_main() -> Iterator[None]:
    """Prevents processes that start in this context from running the program's script again.

    Functions of the script are pickled by value. Therefore scripts need no
    `if __name__ == "__main__":`, scripts from stdin work, and workers do not import the script's
    modules.
    """
    with _STARTING:
        main, sys.modules["__main__"] = sys.modules["__main__"], types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main
