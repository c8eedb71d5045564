"""What the commands share: the terminal, progress bars, common arguments."""

from typing import Annotated, Any

import rich.console
import rich.progress
import typer

from softgym_mj.registry import TASKS

console = rich.console.Console()

Task = Annotated[
    str,
    typer.Argument(
        help="Task name, see `softgym-mj list`; MODULE:NAME for one that a module of yours, "
        "installed or in the current folder, registers when it is imported.",
        autocompletion=lambda incomplete: [name for name in TASKS if name.startswith(incomplete)],
    ),
]
Actor = Annotated[
    str | None, typer.Option(help="What acts, such as picker or franka; else the task's own.")
]
Grasp = Annotated[
    str | None, typer.Option(help="How arms hold: attach or friction; else the task's own.")
]
Ray = Annotated[
    str | None,
    typer.Option(help="Ray cluster: its address, auto, or local for one of --jobs cores."),
]


def acting(actor: str | None, grasp: str | None) -> dict[str, Any]:
    """The arguments of a task that say what acts: of the options those that were given."""
    given = {"actor": actor, "grasp": grasp}
    return {name: value for name, value in given.items() if value is not None}


def progress_bar(*columns: rich.progress.ProgressColumn) -> rich.progress.Progress:
    """A bar with counts and times, and further columns behind them."""
    return rich.progress.Progress(
        rich.progress.TextColumn("{task.description}"),
        rich.progress.BarColumn(),
        rich.progress.MofNCompleteColumn(),
        rich.progress.TimeElapsedColumn(),
        rich.progress.TimeRemainingColumn(),
        *columns,
        console=console,
    )
