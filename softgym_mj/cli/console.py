"""What the commands share: the terminal, progress bars, common arguments."""

import json
from collections.abc import Sequence
from typing import Annotated, Any

import rich.console
import rich.progress
import typer

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.registry import TASKS, TaskRecord
from softgym_mj.rendering.look import LOOKS, PAPER
from softgym_mj.variations.indices import split_indices

console = rich.console.Console(markup=False, emoji=False)  # Users give much of the text.

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
Look = Annotated[
    str | None,
    typer.Option(help=f"How it is drawn: {' or '.join(LOOKS)}, which is slower, for people."),
]
Trust = Annotated[
    bool,
    typer.Option("--trust", help="Load FILE.pt2, which can run any code: whose it is, you trust."),
]
Settings = Annotated[
    str,
    typer.Option(
        help='Arguments of the task as JSON: \'{"actor": "franka", "grasp": "friction"}\'.'
    ),
]
Ray = Annotated[
    str | None,
    typer.Option(help="Ray cluster: its address, auto, or local for one of --jobs cores."),
]


def given(**options: str | None) -> dict[str, Any]:
    """Those of some options that were given, as arguments of a task."""
    return {name: value for name, value in options.items() if value is not None}


def for_people(
    record: TaskRecord, actor: str | None, grasp: str | None, look: str | None = None
) -> dict[str, Any]:
    """Arguments of a task whose pictures are for people; a custom one need not take a look."""
    if look is None and "look" in record.arguments:
        look = PAPER.name
    return given(actor=actor, grasp=grasp, look=look)


def parsed_settings(settings: str) -> dict[str, Any]:
    """What `Settings` says.

    Raises:
        InvalidArgumentError: if it is not a JSON object.
    """
    try:
        parsed = json.loads(settings)
    except (ValueError, RecursionError):
        parsed = None
    if not isinstance(parsed, dict):
        raise InvalidArgumentError("settings", settings, "a JSON object")
    return parsed


def first_variations(split: str, episodes: int, start: int | None = None) -> Sequence[int]:
    """The variations of a split that `episodes` episodes play, one each.

    Args:
        split: "train", "evaluate" or "all".
        episodes: how many.
        start: the first of them; None for the split's.

    Raises:
        InvalidArgumentError: if there is no such split; if the split has no such variation, or not
            so many.
    """
    indices = split_indices(split)
    if start is not None:
        if start not in indices:
            valid = f"{indices[0]}..{indices[-1]}, the variations of {split!r}"
            raise InvalidArgumentError("start", start, valid)
        indices = indices[indices.index(start) :]
    if not 1 <= episodes <= len(indices):
        valid = f"1..{len(indices)}, as {split!r} has no more from variation {indices[0]} on"
        raise InvalidArgumentError("episodes", episodes, valid)
    return indices[:episodes]


def progress_bar(*columns: rich.progress.ProgressColumn) -> rich.progress.Progress:
    """A bar with counts and times, and further columns behind them."""
    return rich.progress.Progress(
        rich.progress.TextColumn("{task.description}", markup=False),
        rich.progress.BarColumn(),
        rich.progress.MofNCompleteColumn(),
        rich.progress.TimeElapsedColumn(),
        rich.progress.TimeRemainingColumn(),
        *columns,
        console=console,
    )
