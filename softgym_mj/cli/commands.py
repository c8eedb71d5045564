"""The command line: softgym-mj list | demo | rollout | evaluate | plot | ..."""

import logging
import os
import platform
import signal
import sys
from collections.abc import Callable
from typing import Annotated

import mujoco
import rich.console
import rich.logging
import typer
import typer.core

import softgym_mj
from softgym_mj.cli import (
    data,
    devices,
    evaluation,
    identification,
    learning,
    photo,
    playing,
    training,
    validation,
    view,
)
from softgym_mj.exceptions import SoftGymError


class _Commands(typer.core.TyperGroup):
    """Command group that ends with one line and exit status 130 when it is interrupted."""

    def invoke(self, ctx):
        before = signal.getsignal(signal.SIGINT)
        received = []

        def interrupt(*signals):
            received.append(signals)
            raise KeyboardInterrupt

        try:
            if before is signal.SIG_DFL:  # `softgym_mj_command` sets it to end without a traceback.
                signal.signal(signal.SIGINT, interrupt)
            return super().invoke(ctx)
        except (KeyboardInterrupt, Exception) as error:
            known = isinstance(error, KeyboardInterrupt)
            if not known and not received:
                raise
            before = signal.SIG_DFL  # A second Ctrl-C ends the process at once.
            signal.signal(signal.SIGINT, before)
            # Libraries may turn the interrupt into another error, as ctypes into ArgumentError.
            parts = map(str, error.args) if known else ()
            typer.echo("; ".join(["interrupted", *parts]), err=True)
            raise typer.Exit(130) from None
        finally:
            signal.signal(signal.SIGINT, before)


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    rich_markup_mode="markdown",  # "rich" reads units such as [m] as markup.
    pretty_exceptions_enable=False,  # Errors in code of users are ordinary tracebacks.
)
_PANELS: dict[str, dict[str, Callable[..., None]]] = {
    "Tasks": {
        "demo": playing.demo,
        "list": playing.list_tasks,
        "view": view.view,
        "rollout": playing.rollout,
        "photo": photo.photo,
    },
    "Policies": {
        "train": training.train,
        "evaluate": evaluation.evaluate,
        "plot": evaluation.plot,
    },
    "Data and speed": {
        "record": data.record,
        "generate": data.generate,
        "bench": devices.bench,
        "compile": devices.compile_kernels,
    },
}
for panel, commands in _PANELS.items():
    for name, command in commands.items():
        app.command(name, rich_help_panel=panel)(command)
app.add_typer(learning.app, name="learning", rich_help_panel="Policies")
app.add_typer(validation.app, name="validate", rich_help_panel="Comparison with reality")
app.add_typer(identification.app, name="identify", rich_help_panel="Comparison with reality")


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        versions = f"softgym-mj {softgym_mj.__version__} (MuJoCo {mujoco.__version__}"
        typer.echo(f"{versions}, Python {platform.python_version()})")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show versions."),
    ] = False,
) -> None:
    """Deformable-object manipulation tasks on MuJoCo."""


def main() -> None:
    """Runs the command line; an error of this package or of a file is one line, exit status 1.

    Custom tasks and policies can be imported from the current folder, as with `python -m`.
    """
    # Long work, such as a first reset, is announced by the package at level INFO.
    log = logging.getLogger("softgym_mj")
    errors = rich.console.Console(stderr=True)
    log.handlers = [rich.logging.RichHandler(console=errors, show_level=False, show_path=False)]
    log.setLevel(logging.INFO)
    log.propagate = False  # absl's handler of the root logger would print each line again.
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # At the end: installed packages have priority.
    try:
        app()
    except (SoftGymError, OSError) as error:
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        raise SystemExit(1) from None
    finally:
        log.propagate = True


if __name__ == "__main__":
    main()
