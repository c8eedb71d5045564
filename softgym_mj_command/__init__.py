"""The command `softgym-mj`, apart from the package, which takes a second to import.

Until a command runs, Ctrl-C ends the process as it ends any program: without a traceback.
"""

import signal


def main() -> None:
    """Imports the package and runs the command line."""
    # A shell has programs that it starts in the background ignore Ctrl-C: that remains.
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from softgym_mj.cli.commands import main as run

    run()
