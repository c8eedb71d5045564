"""The command line: softgym-mj list | demo | rollout | oracle | evaluate | plot | ..."""

import os
import signal
import sys

import typer
import typer.core

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
    """Ends with one line and exit status 130 when it is interrupted."""

    def invoke(self, ctx):
        before = signal.getsignal(signal.SIGINT)
        try:
            if before is signal.SIG_DFL:  # Of `softgym_mj_command`, which is silent.
                signal.signal(signal.SIGINT, signal.default_int_handler)
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            before = signal.SIG_DFL  # Once more, and it ends at once.
            signal.signal(signal.SIGINT, before)
            typer.echo("; ".join(["interrupted", *map(str, interrupt.args)]), err=True)
            raise typer.Exit(130) from None
        finally:
            signal.signal(signal.SIGINT, before)


app = typer.Typer(
    cls=_Commands,
    help="Deformable-object manipulation tasks on MuJoCo.",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # "rich" takes units, [m], for its own.
)
app.command("list")(playing.list_tasks)
app.command()(playing.demo)
app.command()(playing.rollout)
app.command()(playing.oracle)
app.command()(evaluation.evaluate)
app.command()(evaluation.plot)
app.command()(data.generate)
app.command()(data.record)
app.command()(view.view)
app.command()(photo.photo)
app.command("compile")(devices.compile_programs)
app.command()(devices.bench)
app.command()(training.train)
app.add_typer(learning.app, name="learning")
app.add_typer(validation.app, name="validate")
app.add_typer(identification.app, name="identify")


def main() -> None:
    """Runs the command line; an error of this package or of a file is one line, exit status 1.

    Modules of the current folder can be imported, as with `python -m`: tasks and policies of yours.
    """
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # Behind what is installed, such as this package.
    try:
        app()
    except (SoftGymError, OSError) as error:
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        raise SystemExit(1) from None


if __name__ == "__main__":
    main()
