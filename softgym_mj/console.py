"""What the commands share: the terminal, progress bars, common arguments."""

from typing import Annotated

import rich.console
import rich.progress
import typer

console = rich.console.Console()

Task = Annotated[str, typer.Argument(help="Task name, see `softgym-mj list`.")]
Actor = Annotated[
    str | None, typer.Option(help="What acts, such as picker or franka; else the task's own.")
]
Ray = Annotated[
    str | None,
    typer.Option(help="Ray cluster: its address, auto, or local for one of --jobs cores."),
]


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
